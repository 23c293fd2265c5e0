/// Bodies and surfaces that supports hold or move are pressed into each other, or into obstacles.
#include "phyxel/held_overlaps.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/physics/contact.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

const std::string cube =
    "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n";
const std::string held = "[[body.fixed]]\nall = true\n";

/// A motion along x in 0.1 s. @param select which phyxels
std::string moved(double way, const std::string& select = "all = true") {
  return fmt::format("[[body.motion]]\n{}\ndisplacement = [{}, 0, 0]\nduration = 0.1\n", select,
                     way);
}

/// A body, with its supports last.
std::string cube_at(const std::string& name, double x, const std::string& supports,
                    const std::string& shape = cube) {
  return body(name, shape, fmt::format("translation = [{}, 0.01, 0]\n", x)) + supports;
}

/// Two cubes with a gap of 0.01 m, the second of which is moved against the first.
std::string pressed(double way, const std::string& supports = held,
                    const std::string& select = "all = true") {
  return end + "[contact]\n" + cube_at("anvil", -0.1, supports) +
         cube_at("hammer", 0.11, moved(way, select));
}

constexpr double step = 2.5e-3;

/// The message that ends a run, looked at each 10 ms.
std::string message_of(Way& way, double until = 0.1) {
  try {
    while (way.solver.time() < until - 1e-9) {
      way.solver.step(std::llround(0.01 / way.solver.dt()));
      way.contacts();
    }
  } catch (const DivergedError& error) {
    return error.what();
  }
  return "";
}

TEST(HeldOverlaps, OfBodiesHeldAsWholesHaveTheDepthOfTheirMotions) {
  for (const double way : {-0.015, -0.03, -0.06}) {
    Way run(pressed(way), step);
    run.solver.step(40);
    const HeldOverlaps found = find_held_overlaps(run.model, run.solver, {});
    for (const HeldOverlap& overlap : found.of_bodies) {
      EXPECT_NEAR(overlap.depth, -way - 0.01, 1e-4);
      EXPECT_TRUE(overlap.is_whole);
    }
    EXPECT_NEAR(run.contacts()[0].depth, -way - 0.01, 1e-4);
    HeldOverlaps deepest;
    deepest.keep_wholes(found);
    EXPECT_THAT(warning_of_held_overlaps(run.model, deepest), HasSubstr("as a whole"));
  }
}

TEST(HeldOverlaps, AreNotSeenInBodiesThatTouch) {
  Way run(pressed(-0.01), step);
  run.solver.step(40);
  HeldOverlaps deepest;
  deepest.keep_wholes(find_held_overlaps(run.model, run.solver, {}));
  EXPECT_EQ(warning_of_held_overlaps(run.model, deepest), "");
}

TEST(HeldOverlaps, EndARunWhereTheyAreDeeperThanASupport) {
  Way run(pressed(-0.15), step);
  EXPECT_THAT(message_of(run), HasSubstr("phyxels of body \"anvil\" that supports hold or move"));
}

TEST(HeldOverlaps, AreThoseOfTurnedBodies) {
  // A quarter of a turn leads a bar into a cube beside it.
  Way run(end + "[contact]\n" + cube_at("anvil", -0.15, held) +
              body("bar",
                   "shape = 'block'\nsize = [0.1, 0.4, 0.1]\nspacing = 0.05\nlattice = 'nodes'\n",
                   "translation = [0.1, 0.01, 0]\n") +
              "[[body.motion]]\nall = true\nrotation = [0, 0, 90]\nabout = [0.1, 0.01, 0]\n"
              "duration = 0.1\n",
          step);
  run.solver.step(40);
  const HeldOverlaps found = find_held_overlaps(run.model, run.solver, {});
  EXPECT_NEAR(found.of_bodies[1].depth, 0.05, 1e-4);  // from x = -0.1 m to -0.05 m
}

TEST(HeldOverlaps, OfFacesAreSeenAtAnyDepth) {
  const std::string face = "box = [[-1, -1, -1], [0.02, 1, 1]]";
  const std::string of_anvil = "[[body.fixed]]\nbox = [[-0.01, -1, -1], [1, 1, 1]]\n";
  Way run(pressed(-0.06, of_anvil, face), step);
  run.solver.step(40);
  const HeldOverlaps found = find_held_overlaps(run.model, run.solver, {});
  EXPECT_NEAR(found.of_bodies[0].depth, 0.05, 1e-4);
  EXPECT_FALSE(found.of_bodies[0].is_whole);
  Way deeper(pressed(-0.15, of_anvil, face), step);
  EXPECT_THAT(message_of(deeper), HasSubstr("held ones of body"));
}

/// Free phyxels beside held faces that are pressed into each other follow them, and no faster.
TEST(HeldOverlaps, DoNotFlingFreePhyxelsBesideThem) {
  const std::string face = "box = [[-1, -1, -1], [0.02, 1, 1]]";
  for (const char* free_from : {"1", "0.06"}) {
    const std::string of_anvil =
        fmt::format("[[body.fixed]]\nbox = [[-0.01, -1, -1], [1, {}, 1]]\n", free_from);
    Way run(pressed(-0.05, of_anvil, face), step);
    double fastest = 0;
    for (int k = 0; k < 40; ++k) {
      run.solver.step();
      for (const Vec3d v : run.solver.state().velocity) fastest = std::max(fastest, norm(v));
    }
    // The hammer comes at up to 0.75 m/s, and presses phyxels against their neighbours.
    EXPECT_LE(fastest, 0.5 * pressure_wave_speed(run.model.parts[0].material)) << free_from;
    EXPECT_GT(norm(run.contacts()[0].force), 0);
  }
}

TEST(HeldOverlaps, WithObstaclesCountFromTheStart) {
  const std::string wall = obstacle("shape = 'plane'\nnormal = [1, 0, 0]\n");
  {  // a clamp in a wall stays where it is
    Way run(end + wall +
                cube_at("clamped", 0.05,
                        "[[body.fixed]]\nbox = [[-1, -1, -1], [0.01, 1, "
                        "1]]\n[[body.motion]]\nbox = [[0.14, -1, -1], "
                        "[1, 1, 1]]\ndisplacement = [0.01, 0, 0]\n"
                        "duration = 0.1\n"),
            step);
    EXPECT_EQ(message_of(run), "");
  }
  {
    Way run(end + wall + cube_at("pushed", 0.11, moved(-0.02)), step);
    EXPECT_EQ(message_of(run), "");
    EXPECT_NEAR(run.contacts()[0].depth, 0.01, 1e-6);
    HeldOverlaps deepest;
    deepest.keep_wholes(find_held_overlaps(run.model, run.solver, {}));
    EXPECT_THAT(warning_of_held_overlaps(run.model, deepest), HasSubstr("deep in obstacle"));
  }
  Way run(end + wall + cube_at("pushed", 0.11, moved(-0.1)), step);
  EXPECT_THAT(message_of(run), HasSubstr("0.25 of a support"));
}

/// A phyxel that is free almost across the normal of an obstacle moves by no more than thrice the
/// gap, whatever is asked of it.
TEST(HeldOverlaps, DoNotFlingPhyxelsFreeAcrossTheNormal) {
  for (const double across : {0.5, 0.1, 0.02}) {
    const Vec3d normal{std::sqrt(1 - across * across), 0, across};
    const ContactChange change = contact_change({-0.01, normal}, {.free = {0, 0, 1}}, {}, 0.1);
    EXPECT_GT(change.normal.z, 0);
    EXPECT_LE(change.normal.z, 3.2 * 0.1) << across;
  }
  const ContactChange whole = contact_change({-0.01, {0.6, 0, 0.8}}, {.free = {0, 0, 1}}, {}, 0.1);
  EXPECT_NEAR(0.8 * whole.normal.z, 0.1, 1e-15);  // it leaves the obstacle in the step
}

TEST(HeldOverlaps, DoNotComeAboutWithAFreeObstacle) {
  Way run("gravity = [-9.81, 0, 0]\n" + end +
              obstacle("name = 'die'\nshape = 'box'\nsize = [0.1, 0.1, 0.1]\n"
                       "translation = [0.06, 0, 0]\ndensity = 1000\n") +
              cube_at("anvil", -0.1, held),
          step);
  EXPECT_EQ(message_of(run, 0.3), "");
  EXPECT_EQ(run.contacts()[0].depth, 0);
}

/// The depth that ends a run is that of the bodies that overlap, whatever else is in the scene.
TEST(HeldOverlaps, AreAsDeepAsTheSupportsOfTheBodiesThatOverlap) {
  const auto block_of = [](double spacing) {
    return fmt::format("shape = 'block'\nsize = [0.4, 0.4, 0.4]\nspacing = {}\nlattice = 'nodes'\n",
                       spacing);
  };
  // Held faces that are pressed 0.03 m into each other, far from a block of fine phyxels.
  const std::string face = "box = [[-1, -1, -1], [0.05, 1, 1]]";
  const std::string coarse = body("first", block_of(0.1), "translation = [-0.2, 0, 0]\n") +
                             "[[body.fixed]]\nbox = [[-0.05, -1, -1], [1, 1, 1]]\n" +
                             body("second", block_of(0.1), "translation = [0.2, 0, 0]\n") +
                             "[[body.motion]]\n" + face +
                             "\ndisplacement = [-0.06, 0, 0]\nduration = 0.05\n";
  const std::string fine = body("fine",
                                "shape = 'block'\nsize = [0.06, 0.06, 0.06]\nspacing = 0.02\n"
                                "lattice = 'nodes'\n",
                                "translation = [3, 0, 0]\n");
  Way alone(end + "[contact]\n" + coarse, 1e-3), beside(end + "[contact]\n" + coarse + fine, 1e-3);
  for (Way* way : {&alone, &beside}) way->solver.step(50);
  const std::vector<ContactReading> expected = alone.contacts();
  EXPECT_GT(expected[0].depth, 0.05);  // more than a support of the fine block, of 0.04 m
  EXPECT_NEAR(expected[0].depth_share, expected[0].depth / 0.2, 0.3 * expected[0].depth_share);
  const std::vector<ContactReading> found = beside.contacts();  // does not end
  EXPECT_EQ(found[0].depth_share, expected[0].depth_share);
  EXPECT_EQ(found[2].depth, 0);
}

}  // namespace
}  // namespace phyxel
