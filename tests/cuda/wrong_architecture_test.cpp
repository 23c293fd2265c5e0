/// The error of a program whose kernels were built for another GPU. CMakeLists.txt builds the
/// device code of this test for an architecture that is not present.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "device.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(WrongArchitecture, IsNamedWithTheBuildThatWouldDo) {
  const std::vector<Device> devices = cuda_devices();
  if (devices.empty()) GTEST_SKIP() << "no CUDA device";
  const int here = devices[0].major * 10 + devices[0].minor;
  if (here / 10 == PHYXEL_OTHER_ARCHITECTURE / 10) GTEST_SKIP() << "this GPU can run it";
  try {
    use_cuda_device(0);
    FAIL() << "kernels for " << PHYXEL_OTHER_ARCHITECTURE << " ran on " << here;
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("no kernels for " + devices[0].name),
                      HasSubstr("architectures " + std::to_string(PHYXEL_OTHER_ARCHITECTURE)),
                      HasSubstr("-DCMAKE_CUDA_ARCHITECTURES=" + std::to_string(here))));
  }
}

}  // namespace
}  // namespace phyxel
