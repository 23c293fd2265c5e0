/// The program without enough memory or disk space, and without its output folder.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "phyxel/checkpoint.hpp"
#include "phyxel/recorder.hpp"
#include "support/beam_program.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

using Shortage = test::BeamProgram;

TEST_F(Shortage, MoreLatticePhyxelsThanMemoryIsAnError) {
  std::string scene = R"(
[time]
end = 0.1
[[body]]
shape = "block"
size = [1, 1, 1]
phyxels = 2000000000
[body.material]
young = 1e5
poisson = 0.3
density = 1000
)";
  write("huge.toml", scene);
  const Outcome outcome = run({"run", "huge.toml"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("memory"));
}

TEST_F(Shortage, MemoryThatRunsOutLeavesTheLastGoodState) {
  if (PHYXEL_SANITIZED) GTEST_SKIP() << "sanitizers reserve more addresses than any limit allows";
  write("large.toml", R"(
gravity = [0.0, 0.0, -9.81]
[time]
end = 10
[solver]
device = "cpu"
[output]
directory = "out"
frames_per_second = 50
surface = false
[[body]]
shape = "block"
size = [1, 1, 1]
phyxels = 250000
[body.material]
young = 2e5
poisson = 0.3
density = 1000
)");
  // Large arrays come from the system each time and go back to it.
  environment_ = {{"MALLOC_MMAP_THRESHOLD_", "131072"}};
  const pid_t child = start({"run", "large.toml"});
  const auto lines = [&] {
    const std::string log = text_of(folder_ / "out" / "energy.csv");
    return std::count(log.begin(), log.end(), '\n');
  };
  // The log comes last: nothing is written until the next frame.
  for (int wait = 0; wait < 12000 && lines() < 3; ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  std::size_t pages = 0;
  std::ifstream("/proc/" + std::to_string(child) + "/statm") >> pages;
  // 40 MB more than now: energies need some 60 on a CPU, a checkpoint 20.
  const rlim_t bytes = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + 40'000'000;
  const rlimit limit{bytes, bytes};
  ASSERT_EQ(prlimit(child, RLIMIT_AS, &limit, nullptr), 0);
  const Outcome outcome = finish(child);
  EXPECT_EQ(outcome.code, 2) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("out of memory"));
  EXPECT_THAT(outcome.err, HasSubstr("last good state"));
  const auto file = latest_checkpoint(folder_ / "out");
  ASSERT_TRUE(file.has_value());
  const Checkpoint checkpoint = read_checkpoint(*file);
  EXPECT_GE(checkpoint.info.frames_written, 2);
  EXPECT_EQ(read_series(folder_ / "out" / "phyxels.hdf.series").size(),
            static_cast<std::size_t>(checkpoint.info.frames_written));
}

/// A small file system that is unmounted at the end.
class SmallDisk {
 public:
  SmallDisk(const fs::path& folder, const std::string& size) : folder_(folder) {
    fs::create_directories(folder);
    const std::string options = "-o size=" + size + " tmpfs ";
    mounted_ =
        std::system(("mount -t tmpfs " + options + folder.string() + " 2>/dev/null").c_str()) == 0;
  }
  ~SmallDisk() {
    if (!mounted_) return;
    EXPECT_EQ(std::system(("umount " + folder_.string()).c_str()), 0);
  }
  bool mounted() const { return mounted_; }

 private:
  fs::path folder_;
  bool mounted_ = false;
};

TEST_F(Shortage, ADiskTooSmallForTheRunIsRefusedBeforeItStarts) {
  const SmallDisk disk(folder_ / "disk", "600k");
  if (!disk.mounted()) GTEST_SKIP() << "mounting a small disk is not permitted here";
  write_beam("4");
  const Outcome outcome = run({"run", "beam.toml", "--out", "disk/out"});
  EXPECT_EQ(outcome.code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("disk/out"));
  EXPECT_THAT(outcome.err, HasSubstr("are needed"));
}

TEST_F(Shortage, ADiskThatFillsUpEndsTheRunAndSpoilsNothing) {
  const SmallDisk disk(folder_ / "disk", "100m");
  if (!disk.mounted()) GTEST_SKIP() << "mounting a small disk is not permitted here";
  write_beam("20");
  const fs::path out = folder_ / "disk" / "out";
  const pid_t child = start({"run", "beam.toml", "--out", "disk/out"});
  wait_for(out / "surface_000003.hdf");
  {
    std::ofstream filler(folder_ / "disk" / "filler", std::ios::binary);
    const std::string block(1 << 16, 'x');
    while (filler.write(block.data(), static_cast<std::streamsize>(block.size()))) {
    }
  }
  const Outcome outcome = finish(child);
  EXPECT_EQ(outcome.code, 74) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("disk/out"));
  EXPECT_THAT(outcome.err, HasSubstr("No space left"));
  // Each frame in the series was finished before, and has its line in the log.
  const auto series = read_series(out / "phyxels.hdf.series");
  EXPECT_GE(series.size(), 3u);
  for (const SeriesEntry& entry : series) EXPECT_NO_THROW(read_frame(entry.file));
  for (const SeriesEntry& entry : read_series(out / "surface.hdf.series")) {
    EXPECT_NO_THROW(read_frame(entry.file));
  }
  EXPECT_EQ(text_of(out / "energy.csv").back(), '\n');
}

TEST_F(Shortage, AnOutputFolderThatGoesAwayEndsTheRunAndWhatWasWrittenIsWhole) {
  write_beam("100");
  const pid_t child = start({"run", "beam.toml"});
  wait_for(folder_ / "out" / "surface_000003.hdf");
  fs::rename(folder_ / "out", folder_ / "kept");
  write("out", "a file where the folder was");
  const Outcome outcome = finish(child);
  EXPECT_EQ(outcome.code, 74) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("out/"));
  EXPECT_THAT(outcome.err, HasSubstr("cannot be written"));
  EXPECT_EQ(outcome.err.find("error:"), outcome.err.rfind("error:")) << outcome.err;
  for (const char* series : {"phyxels.hdf.series", "surface.hdf.series"}) {
    const auto entries = read_series(folder_ / "kept" / series);
    EXPECT_GE(entries.size(), 3u);
    for (const SeriesEntry& entry : entries) EXPECT_NO_THROW(read_frame(entry.file));
  }
}

/// The error occurs between frames.
TEST_F(Shortage, ACheckpointThatCannotBeWrittenEndsTheRunBetweenFrames) {
  write_beam("1000");
  replace_in_beam("frames_per_second = 50", "frames_per_second = 0\ncheckpoint_every = 0.02");
  const pid_t child = start({"run", "beam.toml"});
  // The first one is that of the start; with the next one a run is under way.
  const auto under_way = [&] {
    const auto latest = latest_checkpoint(folder_ / "out");
    return latest && latest->filename() != "checkpoint_000000000.h5";
  };
  for (int wait = 0; wait < 2000 && !under_way(); ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  fs::rename(folder_ / "out", folder_ / "kept");
  write("out", "a file where the folder was");
  const Outcome outcome = finish(child);
  EXPECT_EQ(outcome.code, 74) << outcome.out << outcome.err;
  // The series, the log and the folder are flushed first; the folder may vanish between any two.
  EXPECT_THAT(outcome.err,
              ContainsRegex("error: out(/[a-z_0-9.]+)?: (cannot be flushed to the disk|cannot be "
                            "written|[0-9]+ bytes could not be written)"));
  EXPECT_TRUE(latest_checkpoint(folder_ / "kept").has_value());
}

TEST_F(Shortage, ACheckpointOnTheWayCountsTheFramesOnDisk) {
  write_beam("100");
  replace_in_beam("frames_per_second = 50", "frames_per_second = 50\ncheckpoint_every = 0.02");
  // No chance to finish anything.
  EXPECT_EQ(interrupted({"run", "beam.toml"}, "out/phyxels_000030.hdf", SIGKILL).code,
            128 + SIGKILL);
  const auto file = latest_checkpoint(folder_ / "out");
  ASSERT_TRUE(file.has_value());
  const Checkpoint checkpoint = read_checkpoint(*file);
  const auto frames = static_cast<std::size_t>(checkpoint.info.frames_written);
  for (const char* name : {"phyxels.hdf.series", "surface.hdf.series"}) {
    const auto series = read_series(folder_ / "out" / name);
    ASSERT_GE(series.size(), frames);
    EXPECT_LE(series[frames - 1].time, checkpoint.state.time + 1e-12);
    // The next frame is one that the resumed run comes to again.
    EXPECT_GT(0.02 * static_cast<double>(frames), checkpoint.state.time + 1e-9);
    for (std::size_t f = 0; f < frames; ++f) EXPECT_NO_THROW(read_frame(series[f].file));
  }
}

}  // namespace
}  // namespace phyxel
