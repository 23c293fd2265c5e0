/// Verlet's steps are halved and doubled without a jump, a drift or a loss of order.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

/// A neo-Hookean cube that spins fast enough to stretch.
Scene spun_scene() {
  Material material = rubber();
  material.law = "neo-hookean";
  material.young = 2e4;
  Scene scene = one_body(material);
  scene.bodies[0].spin = {0, 0, 14};
  return scene;
}

/// A change of the step leaves the time, and displacements and velocities but for terms of second
/// order in dt; the change back takes those away. Steps under gravity, loads, damping and rollers.
TEST(StepChange, HalvesAndDoublesAStepWithoutAJump) {
  Scene scene = spun_scene();
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].material.damping = 3;
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force = {3, 1, 0}, .ramp = 10});
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}}},
                                   .axes = {.x = false, .y = true, .z = true}});
  const Model model = model_of(scene, lattice(6, 6, 6, 0.1, 0.2));
  const auto backend = make_test_backend(model, Precision::double_, 2);
  const double dt = 0.3 * step_limit(model, 1).largest_step;
  Solver solver(model, *backend, initial_state(model, scene, dt), Method::verlet);
  for (int s = 0; s < 200; ++s) solver.step();
  const State start = solver.state();
  const Diagnostics before = diagnose(model, *backend, solver.now());
  solver.looks() = {.next = 210,
                    .last = 190,
                    .change = 0.5,
                    .measured = 180,
                    .measured_share = 0.8,
                    .too_long = 150};
  solver.halve_step();
  const Looks halved{.next = 420,
                     .last = 380,
                     .change = 0.25,
                     .measured = 360,
                     .measured_share = 0.2,
                     .too_long = 300};
  EXPECT_TRUE(solver.looks() == halved);
  const Diagnostics after = diagnose(model, *backend, solver.now());
  EXPECT_EQ(solver.time(), start.time);
  EXPECT_EQ(solver.steps(), 400);
  EXPECT_EQ(solver.dt(), dt / 2);
  // The energies differ by those of leapfrog at two steps, (ω dt)²/8 of them for motions ω: seen
  // 1e-3.
  EXPECT_NEAR(after.elastic_energy(), before.elastic_energy(), 3e-3 * before.elastic_energy());
  EXPECT_NEAR(after.kinetic_energy, before.kinetic_energy, 3e-3 * before.kinetic_energy);
  solver.double_step();
  Looks doubled = halved;
  doubled.double_step();
  EXPECT_TRUE(solver.looks() == doubled);
  EXPECT_EQ(doubled.doublings, 1);
  EXPECT_EQ(doubled.last, 190);
  const State back = solver.state();
  EXPECT_EQ(back.time, start.time);
  EXPECT_EQ(back.step, 200);
  EXPECT_EQ(back.dt, dt);
  double off = 0, moved = 0, slower = 0, speed = 0;
  for (Index i = 0; i < model.size(); ++i) {
    off = std::max(off, norm(back.displacement[i] - start.displacement[i]));
    moved = std::max(moved, norm(start.displacement[i]));
    slower = std::max(slower, norm(back.velocity[i] - start.velocity[i]));
    speed = std::max(speed, norm(start.velocity[i]));
  }
  // Third order, of fast modes too: seen 1.4e-7 and 5.5e-6.
  EXPECT_LT(off, 1e-6 * moved);
  EXPECT_LT(slower, 3e-5 * speed);
  EXPECT_THAT(
      [&] {
        solver.step();
        solver.double_step();
      },
      ::testing::ThrowsMessage<InputError>(
          HasSubstr("step 201: steps can be doubled after an even")));
}

/// Internal forces neither push nor turn a body, and so does no change of the step.
TEST(StepChange, KeepsMomentaWhereTheStepChanges) {
  const Scene scene = spun_scene();
  const Model model = model_of(scene, lattice(6, 6, 6, 0.1, 0.2));
  const auto backend = make_test_backend(model, Precision::double_, 2);
  const double dt = 0.5 * step_limit(model, 1).largest_step;
  Solver solver(model, *backend, initial_state(model, scene, dt), Method::verlet);
  for (int s = 0; s < 100; ++s) solver.step();
  const Diagnostics before = diagnose(model, *backend, solver.now());
  solver.halve_step();
  const Diagnostics after = diagnose(model, *backend, solver.now());
  // Rounding of the forces, a derivative of which is taken over 3e-3 of a support.
  EXPECT_LT(norm(after.momentum - before.momentum), 1e-9 * before.force_scale * dt);
  EXPECT_LT(norm(after.angular_momentum - before.angular_momentum),
            1e-12 * norm(before.angular_momentum));
}

/// Two balls meet off their line of centres: derivatives of forces along velocities are large.
TEST(StepChange, KeepsMomentaInTheMiddleOfAnImpact) {
  const std::string ball = "shape = 'sphere'\nradius = 0.1\nspacing = 0.03\n";
  for (const std::string method : {"", "method = 'penalty'\n"}) {
    Way way(
        end + "[contact]\nfriction = 0.4\n" + method +
            body("left", ball,
                 "translation = [-0.105, 0, 0]\nvelocity = [2, 0, 0]\nspin = [0, 3, 5]\n", 5e4) +
            body("right", ball, "translation = [0.105, 0.05, 0.01]\nvelocity = [-2, 0, 0]\n", 5e4),
        1e-3);
    const double momentum = 2 * way.mass(), turning = 0.1 * momentum;
    const Vec3d pushing = way.momentum(), spinning = way.angular_momentum({});
    double pushed = 0;
    const auto step = [&](int steps) {
      way.solver.step(steps);
      pushed = norm(way.contacts()[0].force);
      EXPECT_LE(norm(way.momentum() - pushing), 1e-13 * momentum) << method;
      EXPECT_LE(norm(way.angular_momentum({}) - spinning), 1e-13 * turning) << method;
    };
    step(30);
    EXPECT_GT(pushed, 10) << method;
    way.solver.halve_step();
    step(10);
    EXPECT_GT(pushed, 10) << method;
    way.solver.double_step();
    step(10);
  }
}

/// Modes of all frequencies ring, at 0.8 of the limit: where the step changes a hundred times at
/// any phase, they keep their energy. With v(t) and u(t) left as they are it would grow tenfold and
/// more, because leapfrog keeps another energy at each step.
TEST(StepChange, GivesNoEnergyToABodyThatChangesItsStepAgainAndAgain) {
  Scene scene = one_body();
  scene.bodies[0].material.law = "small-strain";
  const Model model = model_of(scene, lattice(5, 5, 5, 0.1, 0.2));
  const double dt = 0.8 * step_limit(model, 1).largest_step;
  const auto backend = make_test_backend(model, Precision::double_, 1);
  State start = initial_state(model, scene, dt);
  std::mt19937_64 engine(3);
  const auto any = [&] { return 1e-3 * (static_cast<double>(engine() >> 11) * 0x1p-52 - 1); };
  for (Vec3d& v : start.velocity) v = {any(), any(), any()};
  Solver solver(model, *backend, start, Method::verlet);
  const auto energy = [&] {  // the mean over some steps, in which it swings
    double sum = 0;
    for (int s = 0; s < 40; ++s) {
      sum += diagnose(model, *backend, solver.now()).total_energy() / 40;
      solver.step();
    }
    return sum;
  };
  const double before = energy();
  for (int changes = 0; changes < 100; changes += 2) {
    for (int s = 0; s < 37; ++s) solver.step();
    solver.halve_step();
    for (int s = 0; s < 38; ++s) solver.step();
    solver.double_step();
  }
  // What is left is of third order in (ω dt)²: seen 5%.
  EXPECT_NEAR(energy() / before, 1, 0.2);
}

/// Modes that a step makes unstable have no action to keep: their series would make them grow. The
/// state stays, and its velocities move by the forces.
TEST(StepChange, LeavesAloneWhatAStepDoesNotResolve) {
  Scene scene = one_body();
  scene.bodies[0].material.law = "small-strain";
  const Model model = model_of(scene, lattice(4, 4, 4, 0.1, 0.2));
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const double dt = 3 * step_limit(model, 1).largest_step;
  State start = initial_state(model, scene, dt);
  std::mt19937_64 engine(5);
  for (Vec3d& u : start.displacement) u = uniform_vector(engine, 1e-3);
  Solver solver(model, *backend, start, Method::verlet);
  solver.halve_step();
  EXPECT_TRUE(solver.state().displacement == start.displacement);
}

/// The trajectory beyond differs from that of whole steps as two step sizes do: by their square.
TEST(StepChange, LosesNoOrderByChangesOfTheStep) {
  Scene scene = one_body();
  scene.bodies[0].spin = {0, 2, 1};
  const Model model = model_of(scene, lattice(4, 4, 4, 0.1, 0.2));
  const double dt = 0.4 * step_limit(model, 1).largest_step;
  const auto end_of = [&](double step, int steps, int halve_at) {
    const auto backend = make_test_backend(model, Precision::double_, 1);
    Solver solver(model, *backend, initial_state(model, scene, step), Method::verlet);
    for (std::int64_t last = steps; solver.steps() < last;) {
      if (solver.steps() == halve_at) solver.halve_step(), last *= 2;
      if (solver.steps() == 3 * halve_at) solver.double_step(), last /= 2, halve_at = -1;
      solver.step();
    }
    return solver.state().displacement;
  };
  const auto truth = end_of(dt / 32, 80 * 32, -1);
  const auto error = [&](const std::vector<Vec3d>& u) {
    double squares = 0;
    for (std::size_t i = 0; i < u.size(); ++i) squares += dot(u[i] - truth[i], u[i] - truth[i]);
    return std::sqrt(squares);
  };
  const double coarse = error(end_of(dt, 80, 40)), fine = error(end_of(dt / 2, 160, 80));
  EXPECT_GT(std::log2(coarse / fine), 1.7);
  EXPECT_LT(coarse, 1.5 * error(end_of(dt, 80, -1)));  // not worse than without
}

}  // namespace
}  // namespace phyxel
