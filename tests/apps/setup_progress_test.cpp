/// Output of the stages of set-up: in logs, under mpirun, and not in quiet runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::StartsWith;

class SetupLines : public test::Program {
 protected:
  SetupLines() {
    write("cube.obj",
          "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
          "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n");
    write("scene.toml", R"(
[time]
end = 1
[solver]
device = "cpu"
threads = 1
[[body]]
mesh = "cube.obj"
phyxels = 500
material = { young = 1e5, poisson = 0.3, density = 1000 }
)");
  }
  /// Makes the program show all stages, however short.
  void show_all() { environment_ = {{"PHYXEL_PROGRESS_SECONDS", "0"}}; }
  static std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  }
  /// The lines "100.0%  stage" of these stages.
  static std::vector<std::string> ends_of(const std::vector<std::string>& stages) {
    std::vector<std::string> lines;
    for (const std::string& stage : stages) lines.push_back("100.0%  " + stage);
    return lines;
  }
};

const std::vector<std::string> of_meshes{"reading the mesh",      "inspecting the surface",
                                         "filling the surface",   "placing phyxels",
                                         "evening out distances", "volumes of phyxels"};

TEST_F(SetupLines, EachStageOfSetUpAndSampleIsShownToItsEnd) {
  show_all();
  const Outcome dry = run({"run", "scene.toml", "--dry-run"});
  ASSERT_EQ(dry.code, 0) << dry.err;
  EXPECT_THAT(lines_of(dry.err), IsSupersetOf(ends_of(of_meshes)));
  EXPECT_THAT(lines_of(dry.err), IsSupersetOf(ends_of({"distances between phyxels", "neighbours",
                                                       "phyxels near the surface", "moments",
                                                       "solver arrays", "largest time step"})));
  const Outcome sample = run({"sample", "cube.obj", "--phyxels", "500", "--out", "cube.h5"});
  ASSERT_EQ(sample.code, 0) << sample.err;
  EXPECT_THAT(lines_of(sample.err), IsSupersetOf(ends_of(of_meshes)));
}

TEST_F(SetupLines, ShortStagesAndSilentCommandsLeaveNothing) {
  environment_ = {{"PHYXEL_PROGRESS_SECONDS", "60"}};  // however slow this machine is
  EXPECT_THAT(run({"run", "scene.toml", "--dry-run"}).err, IsEmpty());
  show_all();
  EXPECT_THAT(run({"run", "scene.toml", "--dry-run", "--json"}).err, IsEmpty());
  EXPECT_THAT(run({"info", "scene.toml", "--partition", "2", "--json"}).err, IsEmpty());
  EXPECT_THAT(run({"info", "scene.toml", "--partition", "2"}).err, Not(IsEmpty()));
  EXPECT_THAT(run({"run", "scene.toml", "--until", "0.001", "--quiet"}).err, IsEmpty());
  const Outcome sample =
      run({"sample", "cube.obj", "--phyxels", "500", "--out", "cube.h5", "--json"});
  EXPECT_THAT(sample.err, IsEmpty());
}

TEST_F(SetupLines, OneRankShowsThemForAll) {
  PHYXEL_NEEDS_TOOL(std::string(PHYXEL_MPIRUN) != "", "mpirun");
  show_all();
  environment_.emplace_back("ASAN_OPTIONS", "detect_leaks=0");  // Open MPI leaks
  launcher_ = {PHYXEL_MPIRUN, "--allow-run-as-root", "--oversubscribe", "-n", "2"};
  const Outcome dry = run({"run", "scene.toml", "--dry-run"});
  ASSERT_EQ(dry.code, 0) << dry.err;
  const std::vector<std::string> lines = lines_of(dry.err);
  for (const std::string& end : ends_of({"reading the mesh", "volumes of phyxels", "making phyxels",
                                         "partition", "lists", "share", "largest time step"})) {
    EXPECT_EQ(std::count(lines.begin(), lines.end(), end), 1) << end << '\n' << dry.err;
  }
}

}  // namespace
}  // namespace phyxel
