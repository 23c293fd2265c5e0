/// Bodies from meshes on several ranks under mpirun: supports, loads and probes in space, and the
/// sampler's warnings.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "mpirun.hpp"
#include "support/mesh_content.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

/// The lines of a plan that tell the loads.
std::vector<std::string> loads_said(const std::string& plan) {
  std::vector<std::string> lines;
  std::istringstream in(plan);
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("  load ")) lines.push_back(line);
  }
  return lines;
}

/// The first line of a plan about supports that differ.
std::string supports_said(const std::string& plan) {
  const std::size_t begin = plan.find("supports from "), end = plan.find('\n', begin);
  return begin == std::string::npos ? "" : plan.substr(begin, end - begin);
}

/// Two cubes with supports, loads and probes in space.
const char* const cut_cubes = R"([time]
end = 0.05
[solver]
threads = 1
device = "cpu"
[output]
frames_per_second = 40
fields = ["displacement", "stress", "strain", "principal_stress", "boundary", "history"]
[[body]]
name = "two"
mesh = "cube.stl"
phyxels = 1500
[body.material]
young = 2e4
poisson = 0.3
density = 1000
[[body.inclusion]]
box = [[0.4, 0, 0], [0.7, 1, 1]]
young = 8e4
[[body.fixed]]
box = [[-1, -1, -1], [0.33, 2, 2]]
[[body.motion]]
ball = { centre = [1, 0.5, 0.5], radius = 0.31 }
displacement = [0.02, 0, 0]
rotation = [20, 0, 0]
about = [1, 0.5, 0.5]
duration = 0.05
[[body.load]]
ball = { centre = [0.6, 1, 1], radius = 0.25 }
force = [0, 30, 10]
[[body.traction]]
box = [[0.5, 0.2, 0.9], [0.8, 0.9, 1.1]]
pressure = 200
ramp = 0.02
[[body]]
name = "one"
mesh = "cube.stl"
phyxels = 700
translation = [2, 0, 0]
[body.material]
young = 2e4
poisson = 0.3
density = 1000
viscosity = 1e-3
[[body.fixed]]
box = [[0, 0, 0.7], [9, 9, 9]]
[[body.load]]
box = [[0, 0, -1], [2.7, 9, 0.4]]
force_density = [0, 0, -5000]
[[body.traction]]
all = true
normal = [1, 0, 0]
traction = [0, 100, 0]
[[body]]
name = "ball"
mesh = "ball.stl"
phyxels = 3000
translation = [0, 3, 0]
[body.material]
law = "j2"
young = 2e4
poisson = 0.3
yield_stress = 100
density = 1000
[[body.fixed]]
box = [[-9, 0, -9], [9, 2.8, 9]]
[[body.load]]
all = true
force_density = [0, 0, -900]
[[probe]]
body = "two"
from = [0.2, 0.5, 0.5]
to = [1, 0.5, 0.5]
points = 9
[[probe]]
body = "one"
point = [2.5, 0.5, 0]
[[probe]]
body = "one"
ball = { centre = [2.5, 0.5, 0.5], radius = 0.3 }
)";

/// A cube whose end faces have names.
const std::string grouped_cube = test::cube_vertices +
                                 "g side\nf 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\ng left\n"
                                 "f 1 5 7 3\ng right\nf 2 4 8 6\n";
const char* const cube_of_groups = R"(
[[body]]
name = "three"
mesh = "groups.obj"
phyxels = 600
translation = [4, 0, 0]
[body.material]
young = 2e4
poisson = 0.3
density = 1000
[[body.fixed]]
region = "left"
[[body.traction]]
region = "right"
traction = [100, 0, 50]
[[probe]]
name = "end"
body = "three"
region = "right"
)";

/// A cube made from a mesh, of two materials, is held in a box and moved in a ball that end inside
/// it, loaded in a ball and pressed upon. A second one, of one material, hangs by its own box.
TEST_F(Mpirun, PartsSupportsFromTheRestOfTheirBodyAlikeOnAllRanks) {
  write("cube.stl", test::binary_stl(test::unit_cube()));
  write("ball.stl", test::binary_stl(test::sphere({0, 0, 0}, 0.5, 3)));
  write("groups.obj", grouped_cube);
  write("cube.toml", std::string(cut_cubes) + cube_of_groups);
  const Outcome alone = run_on(0, {"run", "cube.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_THAT(alone.out + alone.err, Not(HasSubstr("warning")));
  for (const int ranks : {2, 3}) {
    const std::string name = std::to_string(ranks);
    const Outcome outcome = run_on(ranks, {"run", "cube.toml", "--out", name});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    expect_same_files("alone", name);
    EXPECT_EQ(loads_said(alone.out), loads_said(outcome.out));
  }
  // The load by volume acts on 0.7 x 1 x 0.4 m³, the pressure on 0.3 x 0.7 m².
  EXPECT_THAT(loads_said(alone.out),
              ElementsAre(HasSubstr("two, load 1: [0, 30, 10] N"),
                          HasSubstr("one, load 1: [0, 0, -1400] N about [2.35, 0.5, 0.2] m"),
                          HasSubstr("ball, load 1: [0, 0, -900] N/m^3"),
                          HasSubstr("two, traction 1"), HasSubstr("one, traction 1"),
                          HasSubstr("three, traction 1: [100, 0, 50] N about [5, 0.5, 0.5] m")));
}

/// A graded cube of two materials that a support cuts, with viscosity, loads and probes.
const char* const graded_cube = R"([time]
end = 0.03
[solver]
threads = 1
device = "cpu"
[output]
frames_per_second = 100
fields = ["displacement", "stress", "boundary"]
[[body]]
mesh = "cube.stl"
phyxels = 1500
[body.grading]
ratio = 4
per_radius = 0
[[body.grading.finer]]
ball = { centre = [1, 1, 0.5], radius = 0.2 }
[body.material]
young = 2e4
poisson = 0.3
density = 1000
viscosity = 1e-3
[[body.inclusion]]
box = [[0.4, 0, 0], [0.7, 1, 1]]
young = 8e4
[[body.fixed]]
box = [[-1, -1, -1], [2, 2, 0.2]]
[[body.load]]
ball = { centre = [1, 1, 1], radius = 0.3 }
force = [0, 30, 10]
[[body.traction]]
all = true
normal = [1, 0, 0]
pressure = 300
follower = true
[[probe]]
from = [0.2, 0.5, 0.5]
to = [1, 0.5, 0.5]
points = 9
)";

TEST_F(Mpirun, GradedBodiesAreTheSameOnAllRanks) {
  write("cube.stl", test::binary_stl(test::unit_cube()));
  write("graded.toml", graded_cube);
  const Outcome alone = run_on(0, {"run", "graded.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_THAT(alone.out + alone.err, Not(HasSubstr("warning")));
  EXPECT_THAT(supports_said(alone.out), HasSubstr("the time step follows from the smallest"));
  for (const int ranks : {2, 3}) {
    const std::string name = std::to_string(ranks);
    const Outcome outcome = run_on(ranks, {"run", "graded.toml", "--out", name});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(supports_said(outcome.out), supports_said(alone.out));
    expect_same_files("alone", name);
  }
}

/// The sampler warns of a vertex that no triangle uses; all ranks sample, and one prints the
/// warning.
TEST_F(Mpirun, WarningsOfMeshesAreShownOnce) {
  write("t.obj",
        "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 2 4 3\nf 2 3 5\nf 3 4 5\nf 2 5 4\n");
  write("t.toml", R"([time]
end = 0.01
[solver]
device = "cpu"
[[body]]
mesh = "t.obj"
phyxels = 200
[body.material]
young = 1e5
poisson = 0.3
density = 1000
)");
  launcher_.clear();
  const std::string warning = "vertices that no triangle uses";
  ASSERT_THAT(run({"run", "t.toml", "--dry-run"}).out, HasSubstr(warning));
  use_ranks(2);
  const Outcome outcome = run({"run", "t.toml", "--dry-run"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::size_t at = outcome.out.find(warning);
  ASSERT_NE(at, std::string::npos) << outcome.out;
  EXPECT_EQ(outcome.out.find(warning, at + 1), std::string::npos) << outcome.out;
}

}  // namespace
}  // namespace phyxel
