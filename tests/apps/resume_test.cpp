/// Continued runs: the files that they may change, the state after any end, and signals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <map>
#include <thread>

#include "phyxel/checkpoint.hpp"
#include "phyxel/recorder.hpp"
#include "support/beam_program.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;

class Resuming : public test::BeamProgram {
 protected:
  /// The beam on the CPU; `more` is added to the keys of its output.
  void write_beam(const std::string& end, const std::string& more = "") const {
    BeamProgram::write_beam(end);
    replace_in_beam("threads = 1", "device = \"cpu\"\nthreads = 1");
    replace_in_beam("frames_per_second = 50\n", "frames_per_second = 50\n" + more);
  }
  /// The files below a folder, by path.
  std::map<std::string, std::string> files_of(const std::string& directory) const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / directory)) {
      if (entry.is_regular_file()) files[entry.path().string()] = text_of(entry.path());
    }
    return files;
  }
  std::string newest(const char* folder) const {
    return latest_checkpoint(folder_ / folder).value_or("none").string();
  }
};

TEST_F(Resuming, ALostLogIsToldAndNoFrameIsTouched) {
  write_beam("0.1");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  fs::remove(folder_ / "out" / "energy.csv");
  const auto before = files_of("out");
  const Outcome outcome = run({"run", "beam.toml", "--resume", "auto", "--until", "0.2"});
  EXPECT_EQ(outcome.code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("energy.csv is missing"));
  EXPECT_TRUE(files_of("out") == before);
}

TEST_F(Resuming, AnotherRunsFolderIsKept) {
  write_beam("0.1");
  ASSERT_EQ(run({"run", "beam.toml", "--out", "a"}).code, 0);
  ASSERT_EQ(run({"run", "beam.toml", "--out", "b", "--until", "0.2"}).code, 0);
  const auto before = files_of("b");
  const std::vector<std::string> onto{"run",   "beam.toml", "--resume", newest("a"),
                                      "--out", "b",         "--until",  "0.2"};
  const Outcome outcome = run(onto);
  EXPECT_EQ(outcome.code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("b: holds a trajectory"));
  EXPECT_TRUE(files_of("b") == before);
  // A folder of its own is filled from the checkpoint on, and is gone on with.
  std::vector<std::string> into = onto;
  into[5] = "c";
  ASSERT_EQ(run(into).code, 0);
  const std::size_t first = read_series(folder_ / "c" / "phyxels.hdf.series").size();
  EXPECT_EQ(first, 5u);
  const Outcome longer =
      run({"run", "beam.toml", "--resume", "auto", "--out", "c", "--until", "0.3"});
  ASSERT_EQ(longer.code, 0) << longer.err;
  EXPECT_EQ(read_series(folder_ / "c" / "phyxels.hdf.series").size(), 10u);
}

/// A folder with the checkpoint of one run and the frames of another.
TEST_F(Resuming, TheLogsFirstEnergyTellsRunsApart) {
  write_beam("0.1");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  const std::string log = text_of(folder_ / "out" / "energy.csv");
  std::string other = log;
  const std::size_t line = other.find('\n') + 1;
  const std::size_t end = other.find('\n', line);
  std::string first = other.substr(line, end - line);
  // Columns: step, time, kinetic, strain, volume, hourglass, gravity, load, total.
  std::size_t column = 0;
  const std::string header = log.substr(0, log.find("total_energy"));
  const auto total = std::count(header.begin(), header.end(), ',');
  for (auto k = total; k > 0; --k) column = first.find(',', column) + 1;
  first.replace(column, first.find(',', column) - column, "1.5");
  other.replace(line, end - line, first);
  write("out/energy.csv", other);
  const auto before = files_of("out");
  const Outcome outcome = run({"run", "beam.toml", "--resume", "auto", "--until", "0.2"});
  EXPECT_EQ(outcome.code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("it belongs to another run"));
  EXPECT_TRUE(files_of("out") == before);
}

TEST_F(Resuming, AFrameCutShortIsNoticed) {
  write_beam("0.1");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  fs::resize_file(folder_ / "out" / "phyxels_000002.hdf", 0);
  const Outcome outcome = run({"run", "beam.toml", "--resume", "auto", "--until", "0.2"});
  EXPECT_EQ(outcome.code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("phyxels_000002.hdf"));
}

TEST_F(Resuming, ARunHasACheckpointFromItsStart) {
  write_beam("1000");
  interrupted({"run", "beam.toml"}, "out/checkpoint_000000000.h5", SIGKILL);
  EXPECT_EQ(read_checkpoint(newest("out")).state.displacement.empty(), false);
  const Outcome outcome = run({"run", "beam.toml", "--resume", "auto", "--until", "0.1"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(read_series(folder_ / "out" / "phyxels.hdf.series").size(), 6u);
}

TEST_F(Resuming, WithoutACheckpointTheRunBeginsAgainWhereOnlyItsStartIsThere) {
  write_beam("0.1");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  const auto whole = files_of("out");
  const auto leave_frames = [&](int frames) {
    for (const auto& [file, text] : whole) {
      const std::string name = fs::path(file).filename();
      const bool later = name.ends_with(".hdf") && name[name.size() - 5] >= '0' + frames;
      if (later || name.ends_with(".h5") || name == "run.json") fs::remove(file);
    }
  };
  leave_frames(1);
  const std::string log = text_of(folder_ / "out" / "energy.csv");
  write("out/energy.csv", log.substr(0, log.find('\n', log.find('\n') + 1) + 1));
  const Outcome again = run({"run", "beam.toml", "--resume", "auto"});
  ASSERT_EQ(again.code, 0) << again.err;
  for (const auto& [file, text] : whole) {
    if (file.ends_with("run.json")) continue;
    EXPECT_TRUE(text_of(file) == text) << file;
  }
  // With more than that there, it is somebody's trajectory.
  leave_frames(3);
  const Outcome kept = run({"run", "beam.toml", "--resume", "auto"});
  EXPECT_EQ(kept.code, 2);
  EXPECT_TRUE(fs::exists(folder_ / "out" / "phyxels_000002.hdf"));
}

TEST_F(Resuming, AFinishedRunKeepsItsSummaryAndAnUnfinishedEndIsMadeGood) {
  write_beam("0.1", "[render]\npictures = true\ncount = 2\nwidth = 64\nheight = 48\n");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  const auto before = files_of("out");
  Outcome outcome = run({"run", "beam.toml", "--resume", "auto"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("nothing is left to do"));
  EXPECT_TRUE(files_of("out") == before);
  // Killed while it drew: pictures and summary are missing.
  fs::remove(folder_ / "out" / "run.json");
  fs::remove_all(folder_ / "out" / "pictures");
  outcome = run({"run", "beam.toml", "--resume", "auto"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const auto& [file, text] : before) {
    EXPECT_TRUE(fs::exists(file)) << file;
    if (file.ends_with("run.json")) continue;
    EXPECT_TRUE(text_of(file) == text) << file;
  }
}

TEST_F(Resuming, EverySignalThatEndsJobsLeavesACheckpoint) {
  write_beam("1000");
  for (const int sent : {SIGHUP, SIGXCPU, SIGPIPE}) {
    const Outcome outcome =
        interrupted({"run", "beam.toml", "--force"}, "out/phyxels_000002.hdf", sent);
    EXPECT_EQ(outcome.code, 75) << sent << outcome.err;
    EXPECT_GT(read_checkpoint(newest("out")).state.step, 0);
    fs::remove_all(folder_ / "out");
  }
}

/// The kernel sends XFSZ for a file that grows beyond the limit of its size.
TEST_F(Resuming, ALimitOfTheSizeOfFilesIsAnErrorOfTheFileThatHitsIt) {
  write_beam("1000");
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{10'000, before.rlim_max};  // less than a frame
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const pid_t child = start({"run", "beam.toml"});
  setrlimit(RLIMIT_FSIZE, &before);
  const Outcome outcome = finish(child);
  EXPECT_EQ(outcome.code, 74) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("error: out/phyxels_000000.hdf: "));
  EXPECT_THAT(outcome.err, HasSubstr("File too large"));
  for (const auto& entry : fs::directory_iterator(folder_ / "out")) {
    EXPECT_NE(entry.path().extension(), ".tmp") << entry.path();
  }
}

TEST_F(Resuming, ASignalDuringSetUpEndsItWithNothingWritten) {
  write_beam("1");
  replace_in_beam("spacing = 0.05", "spacing = 0.004");  // seconds of set-up
  const pid_t child = start({"run", "beam.toml"});
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  kill(child, SIGTERM);
  const Outcome outcome = finish(child);
  EXPECT_EQ(outcome.code, 75) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("during set-up"));
  EXPECT_TRUE(!fs::exists(folder_ / "out") || fs::is_empty(folder_ / "out"));
}

TEST_F(Resuming, AnswersThatCannotBePrintedAreAnError) {
  write_beam("0.02");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"info", "out"}, {"doctor"}, {"info", "beam.toml", "--json"}}) {
    fs::remove(folder_ / "stdout.txt");
    fs::create_symlink("/dev/full", folder_ / "stdout.txt");
    const pid_t child = start(words);
    int status = 0;
    waitpid(child, &status, 0);
    const std::string err = text_of(folder_ / "stderr.txt");
    EXPECT_EQ(WEXITSTATUS(status), 74) << words.front() << err;
    EXPECT_THAT(err, HasSubstr("standard output: cannot be written"));
  }
  fs::remove(folder_ / "stdout.txt");
}

}  // namespace
}  // namespace phyxel
