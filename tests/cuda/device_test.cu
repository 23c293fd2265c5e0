/// Messages when a GPU refuses a launch, runs out of memory or fails.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "check.hpp"
#include "device.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

__global__ void write_through(int* target) { *target = 1; }
__global__ void harmless() {}

template <class Throwing>
std::string message_of(Throwing&& act) {
  try {
    act();
  } catch (const DeviceError& error) {
    EXPECT_EQ(error.code(), ExitCode::device_failed);
    return error.what();
  }
  ADD_FAILURE() << "no DeviceError";
  return "";
}

class DeviceErrors : public ::testing::Test {
 protected:
  void SetUp() override {
    if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
    use_cuda_device(0);
  }
};
using DeviceErrorsDeathTest = DeviceErrors;
using PooledArrays = DeviceErrors;

TEST(Device, NoneIsExplained) {
  if (!cuda_devices().empty()) GTEST_SKIP() << "there is a CUDA device";
  EXPECT_THAT(message_of([] { use_cuda_device(0); }),
              AllOf(HasSubstr("no "), HasSubstr("allowed: the CPU")));
}

TEST_F(PooledArrays, GetTheMemoryOfEarlierOnes) {
  MemoryPool pool(nullptr);
  const PooledMemory pooled(pool);
  const int* first = nullptr;
  {
    const DeviceArray<int> numbers(1000, "numbers");
    first = numbers.data();
    EXPECT_EQ(pool.idle_blocks(), 0u);
  }
  EXPECT_EQ(pool.idle_blocks(), 1u);
  EXPECT_GE(pool.idle_bytes(), 1000 * sizeof(int));
  DeviceArray<int> again(990, "numbers of about the same size"), more(990, "more numbers");
  EXPECT_EQ(again.data(), first);
  EXPECT_NE(more.data(), first);
  std::vector<int> values(990, 7);
  again.upload(values.data());
  again.keep_first(3);
  values.assign(990, 0);
  again.download(values.data());
  EXPECT_EQ(values[2], 7);
  EXPECT_EQ(values[3], 0);
  // Blocks that are not asked for any more go back to the device after many rounds.
  again = {};
  more = {};
  EXPECT_EQ(pool.idle_blocks(), 2u);
  for (int round = 0; round < 100; ++round) pool.begin_round();
  EXPECT_EQ(pool.idle_blocks(), 0u);
}

TEST_F(DeviceErrors, OutOfMemorySaysForWhatHowMuchAndWhatIsThere) {
  const std::string message =
      message_of([] { DeviceArray<float>(std::size_t{1} << 48, "a matrix of the test"); });
  EXPECT_THAT(message, AllOf(HasSubstr("a matrix of the test"), HasSubstr("asks for 1.13e+06 GB"),
                             HasSubstr("are free"), HasSubstr("GPU 0, ")));
  // The device goes on working.
  const DeviceArray<int> small(3, "three numbers");
  const int values[] = {1, 2, 3};
  small.upload(values);
  int back[3] = {};
  small.download(back);
  EXPECT_EQ(back[2], 3);
}

TEST_F(DeviceErrors, ARefusedLaunchIsNamed) {
  write_through<<<1, 4096>>>(nullptr);
  EXPECT_THAT(message_of([] {
                check_launch({"write_through", 1, 4096, "a test"});
              }),
              AllOf(HasSubstr("write_through<<<1, 4096>>> (a test)"), HasSubstr("launched")));
}

TEST_F(DeviceErrors, DevicesAreListed) {
  const std::vector<Device> devices = cuda_devices();
  EXPECT_THAT(devices[0].describe(), AllOf(HasSubstr(devices[0].name), HasSubstr("GB")));
  EXPECT_THAT(message_of([&] { use_cuda_device(static_cast<int>(devices.size())); }),
              HasSubstr("allowed 0 to " + std::to_string(devices.size() - 1)));
  EXPECT_GT(cuda_free_memory(), 0u);
}

/// A fault makes the GPU unusable for the process, so each test has its own process.
void fault_and_report(bool at_once, bool later_launch = false) {
  if (at_once) setenv("PHYXEL_CUDA_SYNC", "1", 1);
  try {
    use_cuda_device(0);
    const Launch launch{"write_through", 1, 1, "a test"};
    write_through<<<1, 1>>>(nullptr);
    check_launch(launch);
    if (later_launch) {
      std::this_thread::sleep_for(std::chrono::seconds(1));  // until the fault has happened
      harmless<<<1, 1>>>();
      check_launch({"harmless", 1, 1, "a test"});
    }
    wait_for_device(launch);
  } catch (const DeviceError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::_Exit(static_cast<int>(error.code()));
  }
  std::_Exit(0);
}

TEST_F(DeviceErrorsDeathTest, AFaultInsideAKernelIsReportedWithTheLastLaunch) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(fault_and_report(false), ::testing::ExitedWithCode(4),
              "a kernel failed: .*cudaErrorIllegalAddress.*last launch was write_through.*"
              "PHYXEL_CUDA_SYNC=1");
}

TEST_F(DeviceErrorsDeathTest, AFaultIsNotBlamedOnALaterLaunch) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(fault_and_report(false, true), ::testing::ExitedWithCode(4),
              "a kernel launched before harmless.* failed: .*cudaErrorIllegalAddress.*"
              "PHYXEL_CUDA_SYNC=1");
}

TEST_F(DeviceErrorsDeathTest, WaitingForEachLaunchNamesTheOneThatFailed) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(fault_and_report(true), ::testing::ExitedWithCode(4),
              "write_through<<<1, 1>>> \\(a test\\) failed: .*cudaErrorIllegalAddress");
}

}  // namespace
}  // namespace phyxel
