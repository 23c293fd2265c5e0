/// Failures on several ranks: a diverged run, a full disk, a stuck and a killed rank.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <thread>

#include "mpirun.hpp"
#include "phyxel/checkpoint.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;

TEST_F(Mpirun, DivergedRunIsToldOnceAndItsLastGoodStateKept) {
  write_scene("5");
  std::string scene = text_of(folder_ / "scene.toml");
  scene.replace(scene.find("ramp = 0.05"), 11, "ramp = 0.5");  // which steps must resolve
  write("scene.toml", scene);
  const Outcome outcome =
      run_on(2, {"run", "scene.toml", "--step", "0.004", "--unsafe-step", "--quiet"});
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_EQ(count_of("the simulation diverged", outcome.err), 1) << outcome.err;
  EXPECT_TRUE(latest_checkpoint(folder_ / "out").has_value());
}

TEST_F(Mpirun, FailedWriteEndsAllRanksOnce) {
  write_scene("100");
  use_ranks(2);
  const pid_t mpirun = start({"run", "scene.toml", "--quiet"});
  wait_for("out/phyxels_000002.hdf");
  // At once: removing file by file would race with the run, which goes on writing.
  fs::rename(folder_ / "out", folder_ / "moved");
  const Outcome outcome = finish(mpirun);
  EXPECT_EQ(outcome.code, 74) << outcome.err;
  EXPECT_EQ(count_of("phyxel: error", outcome.err), 1) << outcome.err;
}

/// Process ids of a process's children.
std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> children;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream stat(entry.path() / "stat");
    const std::string line{std::istreambuf_iterator<char>(stat), {}};
    const auto after_name = line.rfind(')');  // "pid (name) state parent ..."
    if (after_name == std::string::npos) continue;
    if (std::stoi(line.substr(after_name + 4)) == parent) children.push_back(std::stoi(name));
  }
  std::sort(children.begin(), children.end());
  return children;
}

TEST_F(Mpirun, StuckRankIsNamedAndMayComeOn) {
  write_scene("0.4");
  for (const std::size_t which : {0U, 1U}) {
    const std::string out = "stuck" + std::to_string(which);
    use_ranks(2);
    environment_.emplace_back("PHYXEL_WATCHDOG_SECONDS", "2");
    const pid_t mpirun = start({"run", "scene.toml", "--quiet", "--out", out});
    wait_for(out + "/phyxels_000001.hdf");
    const std::vector<pid_t> ranks = children_of(mpirun);
    ASSERT_EQ(ranks.size(), 2u);
    kill(ranks[which], SIGSTOP);
    const std::string name = "rank " + std::to_string(which) + " of 2 has made no progress";
    std::string said;
    for (int wait = 0; wait < 2000 && count_of(name, said) == 0; ++wait) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      said = text_of(folder_ / "stderr.txt");
    }
    kill(ranks[which], SIGCONT);
    const Outcome outcome = finish(mpirun);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(count_of(name, outcome.err), 1) << outcome.err;
    EXPECT_EQ(count_of("has made no progress", outcome.err), 1) << outcome.err;
  }
}

TEST_F(Mpirun, KilledRankEndsAllAndTheLastCheckpointIsWhole) {
  write_scene("100");
  std::string scene = text_of(folder_ / "scene.toml");
  scene.replace(scene.find("frames_per_second"), 0, "checkpoint_every = 0.2\n");
  write("scene.toml", scene);
  use_ranks(2);
  const pid_t mpirun = start({"run", "scene.toml", "--quiet"});
  wait_for("out/phyxels_000003.hdf");
  std::optional<fs::path> checkpoint;
  // The first one is of the start.
  const fs::path first = folder_ / "out" / "checkpoint_000000000.h5";
  ASSERT_TRUE(comes_true([&] {
    checkpoint = latest_checkpoint(folder_ / "out");
    return checkpoint.value_or(first) != first;
  }));
  const std::vector<pid_t> ranks = children_of(mpirun);
  ASSERT_GE(ranks.size(), 2u);
  kill(ranks.back(), SIGKILL);
  EXPECT_NE(finish(mpirun).code, 0);
  checkpoint = latest_checkpoint(folder_ / "out");
  ASSERT_TRUE(checkpoint.has_value());
  const Checkpoint last = read_checkpoint(*checkpoint);
  EXPECT_GT(last.state.step, 0);
  // And it goes on from there.
  const Outcome resumed = run_on(3, {"run", "scene.toml", "--resume", "auto", "--until",
                                     std::to_string(last.state.time + 0.05)});
  EXPECT_EQ(resumed.code, 0) << resumed.err;
}

}  // namespace
}  // namespace phyxel
