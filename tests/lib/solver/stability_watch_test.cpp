/// Runs that have become unstable are stopped, and no others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

TEST(Watch, NamesThePhyxelAndTheTimeOfABlowUp) {
  Scene scene = one_body();
  scene.bodies[0].spin = {0, 0, 1};
  const Model model = model_of(scene, lattice(5, 4, 4, 0.1, 0.2));
  const double dt = 1.3 * step_limit(model).largest_step;
  const auto backend = make_test_backend(model, Precision::single);
  Solver solver(*backend, initial_state(model, scene, dt));
  StabilityWatch watch(model, diagnose(model, *backend, 0, dt));
  try {
    for (int s = 0; s < 5000; ++s) {
      solver.step();
      watch.check(diagnose(model, *backend, solver.steps(), dt));
    }
    FAIL() << "an unstable step was not noticed";
  } catch (const DivergedError& error) {
    EXPECT_NE(std::string(error.what()).find("phyxel "), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("t = "), std::string::npos) << error.what();
    EXPECT_EQ(error.code(), ExitCode::diverged);
  }
}

/// A motion whose parts cancel in a sum still moves.
TEST(Watch, OnlyModelsThatKeepTheirEnergyAreConservative) {
  Scene scene = one_body();
  EXPECT_TRUE(is_conservative(model_of(scene, lattice(3, 3, 3, 0.1))));
  MotionRequest motion;
  motion.select.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}};
  motion.velocity = {1, 0, 0};
  motion.amplitude = {-1, 0, 0};
  motion.frequency = 2;
  scene.bodies[0].motions.push_back(motion);
  EXPECT_FALSE(is_conservative(model_of(scene, lattice(3, 3, 3, 0.1))));
}

/// A body that falls from a wall it is fixed to, and turns over: energy goes from one kind to
/// another and stays the same, so that the watch, which looks at energy in such scenes alone, lets
/// it pass.
TEST(Watch, LetsAStableFallPass) {
  Scene scene = busy_scene();
  scene.bodies[0].loads.clear();  // one that grows would turn the look at energy off
  const Model model = model_of(scene, lattice(8, 3, 4, 0.1, 0.2));
  ASSERT_TRUE(is_conservative(model));
  const double dt = 0.8 * step_limit(model).largest_step;
  const auto backend = make_test_backend(model, Precision::single);
  Solver solver(*backend, initial_state(model, scene, dt));
  const Diagnostics start = diagnose(model, *backend, 0, dt);
  StabilityWatch watch(model, start);
  double fallen = 0;
  for (int s = 0; s < 2000; ++s) {
    solver.step();
    if (s % 50 == 0) {
      const Diagnostics now = diagnose(model, *backend, solver.steps(), dt);
      EXPECT_NO_THROW(watch.check(now));
      fallen = std::max(fallen, -now.gravity_energy);
    }
  }
  EXPECT_GT(fallen, 0.1 * start.kinetic_energy);  // much has changed hands
  // The same watch stops a run that has gained what was never in motion.
  Diagnostics gained = diagnose(model, *backend, solver.steps(), dt);
  gained.kinetic_energy += 3 * (fallen + start.kinetic_energy);
  EXPECT_THROW(watch.check(gained), DivergedError);
}

/// When a whole body is not a number any more, no phyxel is blamed for being the first of a list:
/// the one that was fastest in the last good state is named, by its global id and place.
TEST(Watch, BlamesTheFastestOfTheLastGoodStateNotTheFirstPhyxel) {
  Scene scene = one_body();
  scene.bodies[0].spin = {0, 0, 1};
  const Model model = model_of(scene, lattice(5, 4, 4, 0.1));
  const auto backend = make_test_backend(model, Precision::double_);
  State state = initial_state(model, scene, 1e-4);
  state.velocity[41] = {3, 0, 0};
  backend->upload(state);
  StabilityWatch watch(model, diagnose(model, *backend, 0, state.dt));
  for (Vec3d& u : state.displacement) u = {std::nan(""), 0, 0};
  backend->put(state);
  try {
    watch.check(diagnose(model, *backend, 1, state.dt));
    FAIL();
  } catch (const DivergedError& error) {
    const std::string what = error.what();
    EXPECT_NE(what.find("the state is not finite at t = 0.0001 s"), std::string::npos) << what;
    // Phyxel 41 = 1 + 5 (0 + 4 · 2) is at (1.5, 0.5, 2.5) spacings.
    EXPECT_NE(what.find("was phyxel 41 of body \"body\", at rest at (0.15, 0.05, 0.25) m"),
              std::string::npos)
        << what;
    EXPECT_EQ(what.find("phyxel 0 "), std::string::npos) << what;
  }
}

/// The soft bodies below have waves of 0.4 m/s.
Scene soft_scene() {
  Material material = rubber();
  material.young = 100;
  Scene scene = one_body(material);
  scene.solver.precision = Precision::double_;
  return scene;
}

/// Steps up to a time under the watch. @returns its last diagnostics
Diagnostics watched_to(double end, const Model& model, const Scene& scene, StepPlan plan) {
  const auto backend = make_test_backend(model, Precision::double_, 1);
  Solver solver(model, *backend, initial_state(model, scene, plan.dt), Method::verlet);
  StabilityWatch watch(model, diagnose(model, *backend, solver.now()));
  Diagnostics now;
  while (solver.time() < end) {
    solver.step(10);
    now = diagnose(model, *backend, solver.now());
    EXPECT_NO_THROW(watch.check(now));
  }
  // The watch still sees what nothing drives.
  Diagnostics wrong = now;
  wrong.largest_speed = 1.01 * watch.speed_limit(now.time);
  EXPECT_THROW(watch.check(wrong), DivergedError);
  return now;
}

/// What falls or is pulled for long moves faster than any wave in it: no run has diverged for that.
TEST(Watch, ASoftBodyMayMoveAsFastAsItsSceneMakesIt) {
  const Cloud cloud = lattice(3, 3, 3, 0.1);
  const auto checked = [&](const Scene& scene, double expected) {
    const Model model = model_of(scene, cloud);
    StepPlan plan;
    plan.dt = 0.1 * step_limit(model, 1).largest_step;
    const double end = 2;
    const Diagnostics now = watched_to(end, model, scene, plan);
    EXPECT_GT(expected, 10 * pressure_wave_speed(scene.bodies[0].material));
    // Within a step's growth of what the scene asks; bodies that are pulled swing about it.
    EXPECT_NEAR(now.largest_speed, expected, 0.15 * expected);
  };
  Scene falls = soft_scene();
  falls.gravity = {0, 0, -9.81};
  checked(falls, 9.81 * 2);

  Scene pushed = soft_scene();  // by 20 m/s² after a second
  pushed.bodies[0].loads.push_back({.select = {.all = true}, .force = {27 * 20, 0, 0}, .ramp = 1});
  checked(pushed, 20 * 0.5 + 20);

  const Selection everything{.all = true};
  Scene towed = soft_scene();
  towed.bodies[0].motions.push_back({.select = everything, .velocity = {0, 15, 0}});
  checked(towed, 15);

  Scene moved =
      soft_scene();  // by a smoothstep, whose end is at rest: 1.5 · 30 m / 4 s in the middle
  moved.bodies[0].motions.push_back(
      {.select = everything, .displacement = {30, 0, 0}, .duration = 4});
  checked(moved, 1.5 * 30 / 4);

  Scene turned = soft_scene();  // about an axis 4 m off
  turned.bodies[0].motions.push_back({.select = everything,
                                      .rotation = {0, 0, 12 * 180 / std::numbers::pi},
                                      .about = Vec3d{0.15, -4 + 0.05, 0.15},
                                      .duration = 4});
  checked(turned, 1.5 * 12 / 4 * 4.2);

  Scene shaken = soft_scene();
  shaken.bodies[0].motions.push_back(
      {.select = everything, .amplitude = {0, 0, 3}, .frequency = 1});
  checked(shaken, 2 * std::numbers::pi * 3);  // after whole periods it is fastest
}

/// A run that goes on from a checkpoint is measured against what it began with, as the unbroken one
/// is: its limit of speed, its energy and what was ever in motion.
TEST(Watch, JudgesAResumedRunAsTheUnbrokenOne) {
  Scene scene = soft_scene();
  scene.bodies[0].velocity = {5, 0, 0};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const double dt = 0.5 * step_limit(model, 1).largest_step;
  backend->upload(initial_state(model, scene, dt));
  const Diagnostics start = diagnose(model, *backend, 0, dt);
  StabilityWatch whole(model, start);
  EXPECT_DOUBLE_EQ(whole.speed_limit(0), 50);
  Diagnostics middle = start;  // slower by now, much of its energy lost to something
  middle.step = 100, middle.time = 100 * dt;
  middle.largest_speed = 0.01;
  middle.kinetic_energy *= 0.01;
  whole.check(middle);
  StabilityWatch resumed(model, middle, whole.watched());
  EXPECT_TRUE(resumed.watched() == whole.watched());
  EXPECT_EQ(resumed.speed_limit(3), whole.speed_limit(3));
  Diagnostics later = middle;
  later.kinetic_energy = 1.9 * start.kinetic_energy;  // less gained than was in motion
  EXPECT_NO_THROW(whole.check(later));
  EXPECT_NO_THROW(resumed.check(later));
  later.kinetic_energy = 3.9 * start.kinetic_energy;
  EXPECT_THROW(whole.check(later), DivergedError);
  EXPECT_THROW(resumed.check(later), DivergedError);
  // Of a checkpoint that does not tell the first speed, the present one is taken.
  Watched unknown = whole.watched();
  unknown.start_speed = std::nan("");
  EXPECT_EQ(StabilityWatch(model, middle, unknown).watched().start_speed, middle.largest_speed);
}

}  // namespace
}  // namespace phyxel
