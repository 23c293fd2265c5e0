/// Asynchronous output: the order of jobs, the length of the queue, errors, and equal files.
#include "background_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <future>
#include <map>
#include <memory>
#include <vector>

#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"
#include "support/folder.hpp"
#include "support/two_bodies.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using test::text_of;

/// A gate at which jobs can be made to wait.
class Gate {
 public:
  void open() { opened_.set_value(); }
  void pass() const { opening_.wait(); }

 private:
  std::promise<void> opened_;
  std::shared_future<void> opening_ = opened_.get_future().share();
};

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const OutputError& error) {
    return error.what();
  }
  return "no OutputError";
}

TEST(BackgroundWriter, DoesJobsInOrderOnOneOtherThread) {
  std::vector<int> order;
  std::vector<std::thread::id> threads;
  BackgroundWriter writer;
  for (int k = 0; k < 200; ++k) {
    writer.submit([&, k] {
      order.push_back(k);
      threads.push_back(std::this_thread::get_id());
    });
  }
  writer.finish();
  ASSERT_EQ(order.size(), 200u);
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
  EXPECT_NE(threads.front(), std::this_thread::get_id());
  EXPECT_THAT(threads, ::testing::Each(threads.front()));
}

TEST(BackgroundWriter, TheCallerGoesOnWhileOneJobIsDoneAndOneWaits) {
  Gate gate;
  std::atomic<int> done = 0;
  BackgroundWriter writer;
  for (int k = 0; k < 2; ++k) {
    writer.submit([&] {
      gate.pass();
      ++done;
    });
  }
  EXPECT_EQ(done, 0);
  gate.open();
  writer.finish();
  EXPECT_EQ(done, 2);
}

TEST(BackgroundWriter, WhoeverHasAThirdJobWaits) {
  Gate gate;
  BackgroundWriter writer;
  writer.submit([&] { gate.pass(); });
  writer.submit([] {});
  std::atomic<bool> room = false;
  auto third = std::async(std::launch::async, [&] {
    writer.wait_for_room();
    room = true;
    writer.submit([] {});
  });
  EXPECT_EQ(third.wait_for(std::chrono::milliseconds(50)), std::future_status::timeout);
  EXPECT_FALSE(room);
  gate.open();
  third.get();
  EXPECT_TRUE(room);
}

TEST(BackgroundWriter, NoMoreThanTwoFramesAreHeldHoweverFastTheyCome) {
  std::atomic<int> held = 0, most = 0;
  struct Held {
    explicit Held(std::atomic<int>& c) : count(c) { ++count; }
    ~Held() { --count; }
    std::atomic<int>& count;
  };
  BackgroundWriter writer;
  for (int k = 0; k < 300; ++k) {
    writer.wait_for_room();
    auto frame = std::make_shared<Held>(held);
    most = std::max(most.load(), held.load());
    writer.submit([frame = std::move(frame)] {});
  }
  writer.finish();
  EXPECT_LE(most, 2);
  EXPECT_EQ(held, 0);
}

TEST(BackgroundWriter, AnErrorEndsAllWorkAndEveryLaterCallTells) {
  Gate gate;
  bool written_after = false;
  BackgroundWriter writer;
  writer.check();
  writer.submit([&] {
    gate.pass();
    throw OutputError("out/phyxels_000003.hdf: No space left on device");
  });
  writer.submit([&] { written_after = true; });
  gate.open();
  const std::string expected = "out/phyxels_000003.hdf: No space left on device";
  EXPECT_EQ(message_of([&] { writer.finish(); }), expected);
  EXPECT_EQ(message_of([&] { writer.check(); }), expected);
  EXPECT_EQ(message_of([&] { writer.wait_for_room(); }), expected);
  EXPECT_EQ(message_of([&] { writer.submit([&] { written_after = true; }); }), expected);
  EXPECT_FALSE(written_after);
}

TEST(BackgroundWriter, AnErrorFreesWhoeverWaits) {
  Gate gate;
  BackgroundWriter writer;
  writer.submit([&] {
    gate.pass();
    throw OutputError("full");
  });
  writer.submit([] {});
  auto third = std::async(std::launch::async, [&] { writer.submit([] {}); });
  EXPECT_EQ(third.wait_for(std::chrono::milliseconds(20)), std::future_status::timeout);
  gate.open();
  EXPECT_EQ(message_of([&] { third.get(); }), "full");
}

TEST(BackgroundWriter, TheEndDoesWhatWaitsAlsoWhenAnExceptionPasses) {
  int done = 0;
  EXPECT_THROW(
      {
        BackgroundWriter writer;
        writer.submit([&] { ++done; });
        writer.submit([&] { ++done; });
        throw DivergedError("elsewhere");
      },
      DivergedError);
  EXPECT_EQ(done, 2);
  EXPECT_NO_THROW({
    BackgroundWriter writer;
    writer.submit([] { throw OutputError("nobody asks"); });
  });
}

/// The files of a folder, by name.
std::map<std::string, std::string> content_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    files[entry.path().filename().string()] = text_of(entry.path());
  }
  return files;
}

using BackgroundWriterFiles = test::Folder;

TEST_F(BackgroundWriterFiles, AreTheSameToTheByteAsThoseWrittenAtOnce) {
  const Model model = test::two_bodies();
  Scene scene = test::two_bodies_scene(folder_ / "at_once");
  const auto checkpoint = [&](const Recorder& recorder, const test::TwoBodiesFrame& moment) {
    CheckpointInfo info;
    info.frames_written = recorder.frames_written();
    write_checkpoint(recorder.directory(), moment.state, info);
  };
  {
    Recorder recorder(model, scene, false);
    for (int k = 0; k < 20; ++k) {
      const test::TwoBodiesFrame moment(model, k);
      recorder.write(moment.frame());
      if (k % 7 == 3) checkpoint(recorder, moment);
    }
  }
  scene.output.directory = folder_ / "beside";
  {
    Recorder recorder(model, scene, false);
    BackgroundWriter writer;
    for (int k = 0; k < 20; ++k) {
      const auto moment = std::make_shared<const test::TwoBodiesFrame>(model, k);
      writer.submit([&, moment] { recorder.write(moment->frame()); });
      if (k % 7 == 3) writer.submit([&, moment] { checkpoint(recorder, *moment); });
    }
    writer.finish();
    EXPECT_EQ(recorder.frames_written(), 20);
  }
  const auto one = content_of(folder_ / "at_once"), two = content_of(folder_ / "beside");
  EXPECT_EQ(one.size(), 45u);  // 20 frames of either family, 2 series, 1 log, 2 checkpoints
  EXPECT_TRUE(one == two);
}

TEST_F(BackgroundWriterFiles, AFolderThatIsGoneEndsWritingAndLeavesWhatWasThere) {
  const Model model = test::two_bodies();
  const Scene scene = test::two_bodies_scene(folder_ / "out");
  Recorder recorder(model, scene, false);
  BackgroundWriter writer;
  const auto record = [&](int k) {
    writer.submit([&, moment = std::make_shared<const test::TwoBodiesFrame>(model, k)] {
      recorder.write(moment->frame());
    });
  };
  for (int k = 0; k < 3; ++k) record(k);
  writer.finish();
  fs::rename(folder_ / "out", folder_ / "kept");
  write("out", "a file where the folder was");
  record(3);
  const std::string message = message_of([&] { writer.finish(); });
  EXPECT_THAT(message, ::testing::HasSubstr("phyxels_000003.hdf"));
  EXPECT_THAT(message, ::testing::HasSubstr("Not a directory"));
  EXPECT_EQ(recorder.frames_written(), 3);
  for (const char* series : {"phyxels.hdf.series", "surface.hdf.series"}) {
    const auto entries = read_series(folder_ / "kept" / series);
    EXPECT_EQ(entries.size(), 3u);
    for (const SeriesEntry& entry : entries) EXPECT_NO_THROW(read_frame(entry.file));
  }
}

}  // namespace
}  // namespace phyxel::app
