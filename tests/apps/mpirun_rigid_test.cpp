/// Free rigid bodies on several ranks under mpirun.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mpirun.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using ::testing::HasSubstr;

TEST_F(Mpirun, FreeBodiesMoveTheSameOnAllRanks) {
  // A ball falls on a block, which rests on a floor, beside its middle; a die falls beside it.
  write("scene.toml",
        "gravity = [0, 0, -9.81]\n[time]\nend = 0.25\n[solver]\nprecision = 'double'\n"
        "[output]\nframes_per_second = 50\n"
        "[[obstacle]]\nname = 'floor'\nshape = 'plane'\ntranslation = [0, 0, -0.1]\n"
        "friction = 0.5\n"
        "[[obstacle]]\nname = 'ball'\nshape = 'sphere'\nradius = 0.05\ndensity = 7800\n"
        "friction = 0.3\ntranslation = [0.05, 0.02, 0.2]\nspin = [0, 10, 0]\n"
        "[[obstacle]]\nname = 'die'\nshape = 'box'\nsize = [0.04, 0.04, 0.04]\ndensity = 2000\n"
        "friction = 0.3\ntranslation = [0.2, 0, -0.03]\nrotation = [20, 10, 0]\n"
        "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.04\n"
        "lattice = 'nodes'\n[body.material]\nyoung = 1e6\npoisson = 0.3\ndensity = 1000\n");
  const Outcome alone = run_on(0, {"run", "scene.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_THAT(test::text_of(folder_ / "alone" / "rigid.csv"), HasSubstr(",die,box,"));
  expect_same_on_ranks("scene.toml");
}

TEST_F(Mpirun, FreeBodiesMoveTheSameOnHeldPhyxelsOfAllRanks) {
  // A box lands on a block whose upper part is held, sliding, beside its middle.
  write("scene.toml",
        "gravity = [0, 0, -9.81]\n[time]\nend = 0.1\n[solver]\nprecision = 'double'\n"
        "[output]\nframes_per_second = 50\n"
        "[[obstacle]]\nname = 'box'\nshape = 'box'\nsize = [0.2, 0.2, 0.05]\ndensity = 1000\n"
        "friction = 0.3\ntranslation = [0.02, 0.01, 0.13]\nvelocity = [0.5, 0, 0]\n"
        "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.4, 0.4, 0.2]\nspacing = 0.05\n"
        "lattice = 'nodes'\n[body.material]\nyoung = 1e6\npoisson = 0.3\ndensity = 1000\n"
        "[[body.fixed]]\nbox = [[-1, -1, 0.04], [1, 1, 1]]\n");
  const Outcome alone = run_on(0, {"run", "scene.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  expect_same_on_ranks("scene.toml");
}

TEST_F(Mpirun, AFreeBodyInTheFloorIsRefusedOnce) {
  write("scene.toml",
        "[time]\nend = 0.1\n[contact]\n[[obstacle]]\nname = 'floor'\nshape = 'plane'\n"
        "translation = [0, 0, -0.1]\n"
        "[[obstacle]]\nname = 'ball'\nshape = 'sphere'\nradius = 0.05\ndensity = 1000\n"
        "translation = [0.5, 0, -0.06]\n"
        "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\n"
        "[body.material]\nyoung = 1e6\npoisson = 0.3\ndensity = 1000\n");
  const Outcome outcome = run_on(3, {"run", "scene.toml", "--out", "out"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(count_of("obstacle \"ball\" is 0.01 m deep in obstacle \"floor\"", outcome.err), 1)
      << outcome.err;
}

/// Two cubes with a gap of 0.01 m, the first one held, the second one moved by `way` [m] against
/// it.
std::string pressed(const std::string& way) {
  const auto cube = [](const std::string& name, const std::string& x, const std::string& support) {
    return "[[body]]\nname = '" + name + "'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\n" +
           "spacing = 0.05\nlattice = 'nodes'\ntranslation = [" + x + ", 0.01, 0]\n" +
           "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n" + support +
           "all = true\n";
  };
  return "[time]\nend = 0.1\n[contact]\n[output]\nframes_per_second = 200\n" +
         cube("anvil", "-0.1", "[[body.fixed]]\n") +
         cube("hammer", "0.11",
              "[[body.motion]]\ndisplacement = [" + way + ", 0, 0]\nduration = 0.1\n");
}

TEST_F(Mpirun, BodiesHeldAsWholesThatOverlapAreToldOnce) {
  write("deep.toml", pressed("-0.15"));
  write("scene.toml", pressed("-0.04"));
  for (const int ranks : {0, 2, 3}) {
    const std::string on = std::to_string(ranks);
    const Outcome outcome = run_on(ranks, {"run", "deep.toml", "--out", "deep" + on});
    EXPECT_EQ(outcome.code, 3);
    EXPECT_EQ(count_of("that supports hold or move are", outcome.err), 1) << outcome.err;
    const Outcome warned = run_on(ranks, {"run", "scene.toml", "--out", "out" + on});
    ASSERT_EQ(warned.code, 0) << warned.err;
    EXPECT_THAT(test::text_of(folder_ / ("out" + on) / "run.json"),
                HasSubstr("which supports hold or move as a whole, was 0.03 m deep in body"));
    if (ranks > 0) expect_same_files("out0", "out" + on);
  }
}

}  // namespace
}  // namespace phyxel
