/// Gases, loads along curves and planes of symmetry on several ranks under mpirun.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mpirun.hpp"
#include "support/hollow_cube.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using ::testing::HasSubstr;

/// Blocks that end at planes of symmetry: of two materials, with an end that is clamped up to a
/// plane, and one without phyxels on its planes.
const char* const cut_blocks = R"(
[[body]]
name = "quarter"
shape = "block"
size = [0.8, 0.4, 0.4]
spacing = 0.1
translation = [5, 0.2, 0.2]
[body.material]
young = 2e4
poisson = 0.3
density = 1000
[[body.inclusion]]
box = [[5, 0, 0], [9, 9, 9]]
young = 8e4
[[body.fixed]]
region = "x-"
[[body.fixed]]
indices = [100, 101]
axes = "x"
[[body.symmetry]]
normal = "y"
[[body.symmetry]]
normal = "z"
[[body.load]]
region = "x+"
force = [20, 10, 0]
curve = [[0, 1], [0.02, -1], [0.04, 0.5]]
[[body]]
name = "cells"
shape = "block"
size = [0.8, 0.4, 0.4]
spacing = 0.1
lattice = "cells"
translation = [7, 0, 0]
[body.material]
young = 2e4
poisson = 0.3
density = 1000
[[body.symmetry]]
normal = "x"
at = 6.6
[[body.traction]]
all = true
normal = [1, 0, 0]
pressure = 300
follower = true
curve = [[0, 0], [0.02, 1], [0.04, 0]]
)";

TEST_F(Mpirun, GasesCurvesAndPlanesOfSymmetryAreTheSameOnAllRanks) {
  write("hollow.stl", test::hollow_cube_stl());
  write("loads.toml", "[time]\nend = 0.06\n" + test::hollow_cube_scene + cut_blocks);
  const Outcome alone = run_on(0, {"run", "loads.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_EQ(count_of("body \"cells\", symmetry 1: no layer of phyxels", alone.out + alone.err), 1);
  const std::string reactions = test::text_of(folder_ / "alone" / "reactions.csv");
  for (const char* set : {"quarter,fixed 1", "quarter,fixed 2", "quarter,symmetry 1",
                          "quarter,symmetry 2", "cells,symmetry 1"}) {
    EXPECT_THAT(reactions, HasSubstr(set));
  }
  EXPECT_TRUE(std::filesystem::exists(folder_ / "alone" / "gas.csv"));
  for (const int ranks : {2, 3}) {
    const std::string name = std::to_string(ranks);
    const Outcome outcome = run_on(ranks, {"run", "loads.toml", "--out", name});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    expect_same_files("alone", name);
    EXPECT_EQ(count_of("body \"cells\", symmetry 1: no layer", outcome.out + outcome.err), 1);
  }
}

/// Bodies that meet above a floor, kept apart by penalties, and one of them held at an end.
constexpr const char* soft_contact = R"(
gravity = [0, 0, -9.81]
[time]
end = 0.06
[contact]
method = "penalty"
friction = 0.3
[[obstacle]]
shape = "plane"
translation = [0, 0, -0.201]
[[body]]
name = "held"
shape = "block"
size = [0.4, 0.3, 0.2]
spacing = 0.05
[[body.fixed]]
region = "x-"
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[body]]
name = "thrown"
shape = "sphere"
radius = 0.1
spacing = 0.03
translation = [0.303, 0.02, 0]
velocity = [-0.6, 0, 0]
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[body]]
name = "dropped"
shape = "block"
size = [0.2, 0.2, 0.1]
spacing = 0.04
translation = [0.6, 0, -0.15]
velocity = [0, 0, -0.3]
[body.material]
young = 1e5
poisson = 0.3
density = 1000
)";

TEST_F(Mpirun, PenaltiesBetweenBodiesAreTheSameOnAllRanks) {
  write("soft.toml", soft_contact);
  const Outcome alone = run_on(0, {"run", "soft.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_THAT(alone.out, HasSubstr("penalties of stiffness 0.1"));
  EXPECT_THAT(test::text_of(folder_ / "alone" / "energy.csv"), HasSubstr("contact_energy"));
  expect_same_on_ranks("soft.toml");
}

}  // namespace
}  // namespace phyxel
