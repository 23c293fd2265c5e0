/// Mass-proportional damping against exact solutions, and steps that resolve what moves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

/// A cube that nothing strains: it flies or falls as one, damped by c [1/s].
Scene damped_cube(double c, Vec3d velocity, Vec3d gravity = {}) {
  Scene scene = one_body();
  scene.gravity = gravity;
  scene.bodies[0].velocity = velocity;
  scene.bodies[0].material.damping = c;
  return scene;
}
const Cloud cube = lattice(3, 3, 3, 0.1);

struct Flight {
  Diagnostics start, end;
  double way = 0;  ///< u_x [m] of a phyxel at the end.
};
Flight fly(const Scene& scene, double dt, int steps, Precision precision = Precision::double_) {
  const Model model = model_of(scene, cube);
  const auto backend = make_test_backend(model, precision);
  const Method method = scene.solver.method;
  Solver solver(model, *backend, initial_state(model, scene, dt), method);
  Flight flight;
  flight.start = diagnose(model, *backend, solver.now());
  solver.step(steps);
  flight.end = diagnose(model, *backend, solver.now());
  flight.way = solver.state().displacement[13].x;
  return flight;
}

TEST(Damping, StartsWithTheScenesVelocity) {
  // 27 kg at 2 m/s: 54 J, whatever the damping, the gravity and the step; c dt is up to 1.
  for (const double c : {0.0, 20.0, 200.0}) {
    const Flight flight = fly(damped_cube(c, {2, 0, 0}, {0, 0, -9.81}), 5e-3, 0);
    EXPECT_NEAR(flight.start.kinetic_energy, 54, 54e-14) << c;  // rounding
    EXPECT_NEAR(flight.start.momentum.x, 54, 54e-14) << c;
    EXPECT_NEAR(flight.start.momentum.z, 0, 54e-14) << c;
  }
}

TEST(Damping, SlowsAFreeBodyExactlyAndStopsItNearWhereItShould) {
  // v = v0 exp(-ct) without any error of the step. The way is v0/c (1 - exp(-ct)) but for a share
  // of (c dt)²/24 (1 - exp(-ct)), to leading order: of order two.
  const double c = 20, v0 = 2, end = 0.2;
  for (const double dt : {5e-2, 2.5e-2, 1.25e-2}) {
    const double x = c * dt;
    const Flight flight = fly(damped_cube(c, {v0, 0, 0}), dt, static_cast<int>(end / dt + 0.5));
    EXPECT_NEAR(flight.end.momentum.x, 27 * v0 * std::exp(-c * end), 27 * v0 * 1e-13);
    const double exact = v0 / c * (1 - std::exp(-c * end));
    const double share = 1 - flight.way / exact;
    EXPECT_NEAR(share, x * x / 24, 0.05 * x * x / 24) << dt;  // x⁴ terms: 3% of it at x = 1
  }
  const Flight single = fly(damped_cube(c, {v0, 0, 0}), 5e-2, 4, Precision::single);
  EXPECT_NEAR(single.end.momentum.x, 27 * v0 * std::exp(-c * end), 27 * v0 * 1e-6);
}

TEST(Damping, BalancesGravityAtTheTerminalVelocity) {
  // g/c, also where a step is a thousand times the time that damping takes: what was 61 m/s.
  for (const double c : {50.0, 1e3, 1e6}) {
    const Flight flight = fly(damped_cube(c, {3, 0, 0}, {0, 0, -9.81}), 1e-3, 1000);
    EXPECT_NEAR(flight.end.momentum.z / 27, -9.81 / c, 9.81 / c * 1e-12) << c;
    EXPECT_NEAR(flight.end.momentum.x, 0, 1e-12) << c;
  }
}

TEST(Damping, OfStepsBeyondAllSenseOverflowsNowhere) {
  for (const Precision precision : {Precision::single, Precision::double_, Precision::mixed}) {
    const Flight flight = fly(damped_cube(1e12, {3, 0, 0}, {1, 0, 0}), 1, 3, precision);
    EXPECT_EQ(flight.start.bad_phyxel, -1);
    EXPECT_EQ(flight.end.bad_phyxel, -1);
    EXPECT_LT(std::abs(flight.end.momentum.x), 1e-9);
  }
}

TEST(Damping, OfImplicitStepsStopsABodyExactlyWhereItShould) {
  // u + v/c is a constant of free flight, and linear, so that Runge–Kutta steps keep it to
  // rounding, whatever c dt is; and so is the terminal velocity.
  for (const double c : {20.0, 2e3}) {
    Scene scene = damped_cube(c, {2, 0, 0});
    scene.solver.method = Method::implicit;
    const Flight flight = fly(scene, 0.05, 40);
    EXPECT_NEAR(flight.start.kinetic_energy, 54, 54e-14);
    // 1e-8 is what Newton's method leaves of the forces.
    EXPECT_NEAR(flight.way + flight.end.momentum.x / 27 / c, 2 / c, 1e-7 * 2 / c) << c;
    scene.gravity = {0, 0, -9.81};
    EXPECT_NEAR(fly(scene, 0.05, 40).end.momentum.z / 27, -9.81 / c, 9.81 / c * 1e-6) << c;
  }
}

TEST(Damping, IsTheSameFlowHalfAStepTwice) {
  for (const double c : {0.0, 1e-300, 1e-9, 3.0, 1e3, 1e9}) {
    const DampedFlow half = damped_flow(c, 0.5e-2), whole = damped_flow(c, 1e-2);
    EXPECT_NEAR(half.keep * half.keep, whole.keep, 1e-15);
    EXPECT_NEAR(half.keep * half.gain + half.gain, whole.gain, 1e-15 * 1e-2);
  }
  EXPECT_EQ(damped_flow(0, 0.3).keep, 1);
  EXPECT_EQ(damped_flow(0, 0.3).gain, 0.3);
}

/// Two halves of a body of the least stiffness that do not feel each other: each slows by its own.
TEST(Damping, OfAnInclusionIsItsOwn) {
  for (const Method method : {Method::verlet, Method::implicit}) {
    Scene scene = damped_cube(1, {1, 0, 0});
    scene.solver.method = method;
    scene.bodies[0].material.young = 1e-6;
    Material slow = scene.bodies[0].material;
    slow.damping = 10;
    scene.bodies[0].inclusions.push_back(
        {.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}}}, .material = slow});
    const Model model = model_of(scene, cube);
    ASSERT_EQ(model.parts.size(), 2u);
    const auto backend = make_test_backend(model, Precision::double_);
    const double dt = 0.01;
    Solver solver(model, *backend, initial_state(model, scene, dt), method);
    const double start = diagnose(model, *backend, solver.now()).kinetic_energy;
    EXPECT_NEAR(start, 13.5, 1e-12);  // 27 kg at 1 m/s, of both
    solver.step(20);
    // 18 kg slowed by 1/s and 9 kg by 10/s for 0.2 s. Verlet's decay is exact; implicit steps are
    // off by (c dt)²/50 or so of 10 · 0.2; the soft body's own forces are below 1e-6.
    const double expected = 18 * std::exp(-0.2) + 9 * std::exp(-2.0);
    EXPECT_NEAR(diagnose(model, *backend, solver.now()).momentum.x, expected,
                method == Method::verlet ? 1e-6 : 1e-2);
  }
}

std::string refusal_of(const Scene& scene, const Model& model, bool unsafe = false) {
  const auto backend = make_test_backend(model, Precision::double_);
  try {
    plan_steps(scene, model, *backend, unsafe);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}
double step_of(const Scene& scene, const Model& model) {
  const auto backend = make_test_backend(model, Precision::double_);
  return plan_steps(scene, model, *backend).dt;
}

TEST(StepPlan, KeepsStepsShortAgainstDamping) {
  Scene scene = damped_cube(1e4, {});
  const Model model = model_of(scene, cube);
  const double stable = step_limit(model).largest_step;
  ASSERT_GT(stable, 2e-4);  // so that damping decides
  EXPECT_LE(step_of(scene, model), 0.5e-4);
  EXPECT_GT(step_of(scene, model), 0.4e-4);
  scene.time.step = 0.9e-4;
  EXPECT_EQ(refusal_of(scene, model), "");
  scene.time.step = 1.1e-4;
  EXPECT_THAT(refusal_of(scene, model),
              HasSubstr("time.step = 0.00011 s is too long for body.material.damping = 10000 1/s"));
  EXPECT_THAT(refusal_of(scene, model), HasSubstr("allowed at most 0.0001 s"));
  EXPECT_EQ(refusal_of(scene, model, true), "");
}

/// Devices find the limit to different last digits; the step has three digits, just below.
TEST(StepPlan, KeepsThreeDigitsOfTheStep) {
  for (const double young : {1e2, 1e5, 3e8}) {
    Scene scene = one_body();
    scene.bodies[0].material.young = young;
    scene.output.frames_per_second = 0;
    scene.time.safety = 0.7;
    scene.time.end = 1e6;  // more than 1e7 steps: to end on a whole one changes the eighth digit
    const Model model = model_of(scene, cube);
    const auto backend = make_test_backend(model, Precision::double_);
    const StepPlan plan = plan_steps(scene, model, *backend);
    double digits = plan.dt;  // as a number from 100 to 999
    while (digits < 100) digits *= 10;
    EXPECT_NEAR(digits, std::round(digits), 1e-3) << plan.dt;
    EXPECT_LE(digits, 1000);
    EXPECT_LE(plan.dt, 0.7 * plan.limit.largest_step);
    EXPECT_GE(plan.dt, 0.7 * plan.limit.largest_step * (1 - 1e-2));
  }
}

MotionRequest shake(double frequency) {
  MotionRequest motion;
  motion.select.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}};
  motion.select.where = "a.toml:9:1";
  motion.amplitude = {0.01, 0, 0};
  motion.frequency = frequency;
  return motion;
}

/// What was lost: a shake of one or several whole periods a step moves nothing.
TEST(StepPlan, ResolvesMotionsThatAreFasterThanSound) {
  for (const double frequency : {100.0, 1e3, 2e3, 1e4}) {
    Scene scene = one_body();
    scene.time.end = 0.25 / frequency;  // to the far end of the shake
    scene.bodies[0].motions.push_back(shake(frequency));
    const Model model = model_of(scene, cube);
    const auto backend = make_test_backend(model, Precision::double_);
    const StepPlan plan = plan_steps(scene, model, *backend);
    EXPECT_LE(plan.dt, 1 / (20 * frequency) * (1 + 1e-9));
    Solver solver(*backend, initial_state(model, scene, plan.dt));
    solver.step(plan.steps);
    EXPECT_NEAR(solver.state().displacement[0].x, 0.01, 1e-12) << frequency;
  }
}

TEST(StepPlan, RefusesStepsOfTheScenesThatResolveNoMotionOrRamp) {
  for (const Method method : {Method::verlet, Method::implicit}) {
    Scene scene = one_body();
    scene.solver.method = method;
    const Model model = model_of(scene, cube);
    const auto with = [&](auto&& change, double step) {
      Scene changed = scene;
      change(changed.bodies[0]);
      changed.time.step = step;
      return refusal_of(changed, model);
    };
    const auto shaken = [](BodyRequest& body) { body.motions.push_back(shake(1e3)); };
    EXPECT_EQ(with(shaken, 0.5e-4), "");
    EXPECT_THAT(with(shaken, 0.6e-4),
                HasSubstr("a.toml:9:1: time.step = 6e-05 s does not resolve body.motion.frequency "
                          "= 1000 Hz of body \"body\": allowed at most 5e-05 s"));
    const auto moved = [](BodyRequest& body) {
      body.motions.push_back(
          {.select = {.all = true}, .displacement = {1, 0, 0}, .duration = 1e-3});
    };
    EXPECT_EQ(with(moved, 0.5e-4), "");
    EXPECT_THAT(with(moved, 0.6e-4), HasSubstr("body.motion.duration = 0.001 s"));
    const auto turned = [](BodyRequest& body) {  // ten turns, at most 15 to a duration
      body.motions.push_back({.select = {.all = true}, .rotation = {3600, 0, 0}, .duration = 1e-2});
    };
    EXPECT_EQ(with(turned, 1e-2 / 15 / 20.1), "");
    EXPECT_THAT(with(turned, 1e-2 / 15 / 19.9), HasSubstr("body.motion.rotation, 3600 degrees"));
    const auto pulled = [](BodyRequest& body) {
      body.loads.push_back({.select = {.all = true}, .force = {1, 0, 0}, .ramp = 1e-3});
    };
    EXPECT_EQ(with(pulled, 0.5e-4), "");
    EXPECT_THAT(with(pulled, 0.6e-4), HasSubstr("body.load.ramp = 0.001 s"));
    const auto at_once = [](BodyRequest& body) {
      body.loads.push_back({.select = {.all = true}, .force = {1, 0, 0}, .ramp = 0});
    };
    EXPECT_EQ(with(at_once, 1e-4), "");
  }
}

/// An upper bound, although Lanczos stops at a Ritz value below the largest eigenvalue.
TEST(StepLimit, AddsWhatTheIterationLeaves) {
  const Model model = model_of(one_body(), lattice(8, 4, 4, 0.1, 0.2));
  const StepLimit limit = step_limit(model);
  ASSERT_LT(limit.iterations, 100);  // it stopped at its tolerance, not at its end
  // The limit's own iteration, carried far beyond that tolerance: a power iteration of what the
  // step sees is stable below 2/ω and grows above, so that ω follows from its growth.
  const auto backend = make_test_backend(model, Precision::double_);
  std::vector<Vec3d> u = random_deformation(model, 0.05), force;
  double omega_squared = 0;
  for (int k = 0; k < 3000; ++k) {
    double size = 0;
    for (const Vec3d& v : u) size += dot(v, v);
    for (Vec3d& v : u) v = (1e-9 / std::sqrt(size)) * v;
    backend->upload(state_of(u));
    backend->internal_forces(force);
    double product = 0, norm2 = 0;
    for (std::size_t i = 0; i < u.size(); ++i) {
      product -= dot(u[i], force[i]);
      norm2 += model.mass[i] * dot(u[i], u[i]);
      u[i] = (-1 / model.mass[i]) * force[i];
    }
    omega_squared = product / norm2;  // a Rayleigh quotient: from below
  }
  // The quotient is below the eigenvalue, so a limit below the quotient is no bound. What is added
  // is up to 0.2% of the eigenvalue; the Ritz value itself lies 1e-6 or so below.
  EXPECT_GE(limit.omega_max * limit.omega_max, omega_squared * (1 + 1e-5));
  EXPECT_LE(limit.omega_max * limit.omega_max, omega_squared * 1.004);
}

TEST(Diagnostics, CountsPhyxelsThatAreInsideOut) {
  const Model model = model_of(one_body(), lattice(4, 4, 4, 0.1));
  const auto backend = make_test_backend(model, Precision::double_);
  const auto inverted = [&](double stretch) {
    std::vector<Vec3d> u;
    for (const Vec3d& x : model.position) u.push_back({(stretch - 1) * x.x, 0, 0});
    backend->upload(state_of(u));
    return diagnose(model, *backend, 0, 1e-3).inverted;
  };
  EXPECT_EQ(inverted(1), 0);
  EXPECT_EQ(inverted(0.01), 0);  // det F = 0.01, thin but not inside out
  EXPECT_EQ(inverted(-0.01), model.size());
  EXPECT_EQ(inverted(-1), model.size());
  // One phyxel pushed through its neighbours: some are inside out, not all.
  std::vector<Vec3d> u(model.position.size());
  for (std::size_t i = 0; i < u.size(); ++i) {
    if (model.position[i].x < 0.2) u[i].x = -2 * (model.position[i].x - 0.1);
  }
  backend->upload(state_of(u));
  const Index some = diagnose(model, *backend, 0, 1e-3).inverted;
  EXPECT_GT(some, 0);
  EXPECT_LT(some, model.size());
}

TEST(Backend, RefusesAStateOfAnotherSize) {
  const Model model = model_of(one_body(), cube);
  const auto backend = make_test_backend(model, Precision::double_);
  for (const std::size_t size : {std::size_t{0}, std::size_t{26}, std::size_t{28}}) {
    State state = state_of(std::vector<Vec3d>(size));
    EXPECT_THROW(backend->upload(state), InputError) << size;
    state.displacement.resize(27);
    EXPECT_THROW(backend->upload(state), InputError) << size;
    EXPECT_THROW(Solver(*backend, state), InputError) << size;
  }
  EXPECT_NO_THROW(backend->upload(state_of(std::vector<Vec3d>(27))));
}

}  // namespace
}  // namespace phyxel
