/// Runs of the program on several ranks under mpirun.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "support/program.hpp"

namespace phyxel {

class Mpirun : public test::Program {
 protected:
  /// Two bodies, one of them fixed, loaded and moved, with surfels and all fields.
  void write_scene(const std::string& end = "0.1") const {
    write("scene.toml", "gravity = [0.0, 0.0, -9.81]\n[time]\nend = " + end + R"(
[solver]
threads = 1
device = "cpu"
[output]
directory = "out"
frames_per_second = 40
fields = ["displacement", "velocity", "von_mises", "volume_ratio", "mass"]
[[body]]
name = "beam"
shape = "beam"
size = [0.8, 0.2, 0.2]
spacing = 0.04
jitter = 0.1
[body.material]
young = 2e5
poisson = 0.3
density = 1000
[body.neighbours]
support = "adaptive"
[[body.fixed]]
region = "x-"
[[body.load]]
region = "x+"
force = [0.0, 1.0, 0.0]
ramp = 0.05
[[body]]
name = "bug"
shape = "horn_bug"
translation = [10.0, 0.0, 0.0]
spin = [0.0, 1.0, 0.0]
[body.material]
young = 6e5
poisson = 0.3
density = 1000
[[body.motion]]
indices = [3, 40, 200, 201, 202, 203]
amplitude = [0.0, 0.0, 0.01]
frequency = 8
axes = "z"
[[probe]]
body = "beam"
from = [0.0, 0.0, 0.0]
to = [0.8, 0.1, 0.1]
[[probe]]
body = "beam"
region = "x+"
)");
  }
  void use_ranks(int count) {
    launcher_ = {};
    if (count == 0) return;
    launcher_ = {PHYXEL_MPIRUN, "--allow-run-as-root", "--oversubscribe", "-n",
                 std::to_string(count)};
    environment_ = {{"ASAN_OPTIONS", "detect_leaks=0"}};  // Open MPI leaks
  }
  test::Outcome run_on(int count, const std::vector<std::string>& arguments) {
    use_ranks(count);
    return run(arguments);
  }
  /// The files of an output folder, by name, without run.json, which has times and ranks.
  std::map<std::string, std::string> files_of(const std::string& directory) const {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / directory)) {
      if (!entry.is_regular_file() || entry.path().filename() == "run.json") continue;
      files[entry.path().filename().string()] = test::text_of(entry.path());
    }
    return files;
  }
  void expect_same_files(const std::string& a, const std::string& b) const {
    const auto left = files_of(a), right = files_of(b);
    EXPECT_GT(left.size(), 5u);
    ASSERT_EQ(left.size(), right.size());
    for (const auto& [name, content] : left) {
      ASSERT_TRUE(right.contains(name)) << name;
      EXPECT_TRUE(right.at(name) == content) << b << "/" << name;
    }
  }
  /// Expects that a scene on 2 and 3 ranks gives the files in `alone`.
  void expect_same_on_ranks(const std::string& scene) {
    for (const int ranks : {2, 3}) {
      const std::string name = std::to_string(ranks);
      const test::Outcome outcome = run_on(ranks, {"run", scene, "--out", name});
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      expect_same_files("alone", name);
    }
  }
};

/// Number of occurrences of `what`.
inline int count_of(const std::string& what, const std::string& text) {
  int count = 0;
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

}  // namespace phyxel
