/// Implicit steps: their order, what they keep, what they damp, and how far they may reach.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// A bar of 4 × 4 × 12 phyxels, clamped at one end.
Scene clamped_bar() {
  Scene scene = one_body();
  scene.solver.method = Method::implicit;
  scene.bodies[0].material.hourglass = 0.1;
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}}}});
  return scene;
}
Model bar_of(const Scene& scene) { return model_of(scene, lattice(4, 4, 12, 0.1)); }

struct Outcome {
  State end;
  double energy = 0, largest_energy = -1e300;  ///< [J]
};
Outcome run(const Model& model, const Scene& scene, Method method, double dt, int steps) {
  const auto backend = make_test_backend(model, Precision::double_);
  Scene by = scene;
  by.solver.method = method;
  Solver solver(model, *backend, initial_state(model, by, dt), method);
  Outcome run;
  for (int s = 0; s < steps; ++s) {
    solver.step();
    run.energy = diagnose(model, *backend, solver.now()).total_energy();
    run.largest_energy = std::max(run.largest_energy, run.energy);
  }
  run.end = solver.state();
  return run;
}
double distance(const State& a, const State& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.displacement.size(); ++i) {
    const Vec3d d = a.displacement[i] - b.displacement[i];
    squares += dot(d, d);
  }
  return std::sqrt(squares);
}

/// A bar that starts to sag, for about a tenth of its first period: Verlet's steps, forty to each
/// of the shortest implicit one, are the truth.
TEST(Implicit, ConvergesAtSecondOrder) {
  Scene scene = clamped_bar();
  scene.gravity = {0.5, 0, 0};
  const Model model = bar_of(scene);
  constexpr double end = 0.08;
  const State truth = run(model, scene, Method::verlet, end / 1280, 1280).end;
  const double coarse = distance(run(model, scene, Method::implicit, end / 8, 8).end, truth);
  const double middle = distance(run(model, scene, Method::implicit, end / 16, 16).end, truth);
  const double fine = distance(run(model, scene, Method::implicit, end / 32, 32).end, truth);
  // Orders seen: 2.1 and 2.0.
  EXPECT_GT(std::log2(coarse / middle), 1.8);
  EXPECT_GT(std::log2(middle / fine), 1.8);
  EXPECT_LT(std::log2(middle / fine), 2.3);
}

/// Steps hundreds of times Verlet's limit stay below the energy at the start, and come to rest.
TEST(Implicit, SettlesInStepsFarBeyondVerletsLimit) {
  Scene scene = clamped_bar();
  scene.gravity = {0.5, 0, -0.5};
  const Model model = bar_of(scene);
  const double dt = 300 * step_limit(model).largest_step;
  const Outcome settled = run(model, scene, Method::implicit, dt, 30);
  EXPECT_LE(settled.largest_energy, 0);  // of the start
  const auto backend = make_test_backend(model, Precision::double_);
  const Equilibrium rest = find_equilibrium(model, *backend);
  State zero = rest.state;
  for (Vec3d& u : zero.displacement) u = {};
  EXPECT_LT(distance(settled.end, rest.state), 1e-3 * distance(rest.state, zero));
}

/// Sums of inner forces vanish, so linear momentum gathers rounding alone; angular momentum keeps
/// as many digits as the step's order gives: here an eighth of a turn in 40 steps.
TEST(Implicit, KeepsMomentum) {
  Scene scene = one_body();
  scene.solver.method = Method::implicit;
  scene.bodies[0].velocity = {1, 2, 3};
  scene.bodies[0].spin = {0, 0, 4};
  const Model model = model_of(scene, lattice(3, 3, 4, 0.1, 0.1));
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(model, *backend, initial_state(model, scene, 0.005), Method::implicit);
  const Diagnostics start = diagnose(model, *backend, solver.now());
  solver.step(40);
  const Diagnostics end = diagnose(model, *backend, solver.now());
  EXPECT_LT(norm(end.momentum - start.momentum), 1e-13 * norm(start.momentum));
  // About the centre of mass, which moves. Seen: 3e-5.
  const double mass = model.parts[0].mass;
  const auto own_spin = [&](const Diagnostics& d) {
    const Vec3d centre = model.parts[0].centre + (d.time / mass) * start.momentum;
    return d.angular_momentum - cross(centre, d.momentum);
  };
  EXPECT_LT(norm(own_spin(end) - own_spin(start)), 3e-4 * norm(own_spin(start)));
  EXPECT_GT(start.kinetic_energy + start.elastic_energy(),
            end.kinetic_energy + end.elastic_energy());
}

/// v' = -c v: exp(-c t) to second order.
TEST(Implicit, DampingSlowsExponentially) {
  Scene scene = one_body();
  scene.solver.method = Method::implicit;
  scene.bodies[0].material.damping = 2;
  scene.bodies[0].velocity = {1, 0, 0};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const State end = run(model, scene, Method::implicit, 0.02, 50).end;
  // The method's own error: 0.0404 (c dt)² c t = 1.3e-4 of it.
  EXPECT_NEAR(end.velocity[13].x, std::exp(-2.0), 1.5e-4 * std::exp(-2.0));
}

/// Of a load that grows in proportion to time the method integrates the speed without error.
TEST(Implicit, LoadsGrowAndMotionsFollowTheirPaths) {
  Scene scene = one_body();
  scene.solver.method = Method::implicit;
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force = {54, 0, 0}, .ramp = 2});
  const Model free = model_of(scene, lattice(3, 3, 3, 0.1));  // 27 kg
  const State pushed = run(free, scene, Method::implicit, 0.1, 10).end;
  EXPECT_NEAR(pushed.velocity[13].x, 0.5, 1e-8);  // residuals fall to 1e-8

  scene.bodies[0].motions.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {0.1, 1, 1}}},
                                     .displacement = {0.01, 0, 0},
                                     .duration = 0.5,
                                     .axes = {.x = true, .y = false, .z = false}});
  const Model moved = model_of(scene, lattice(3, 3, 3, 0.1));
  const State half = run(moved, scene, Method::implicit, 0.05, 5).end;
  for (const Index i : moved.motions[0].phyxels) {
    EXPECT_EQ(half.displacement[i].x, 0.005);
    EXPECT_NE(half.displacement[i].y, 0);  // free, and pushed aside as the body is squeezed
  }
}

TEST(Implicit, GoesOnFromAStateToTheBit) {
  Scene scene = clamped_bar();
  scene.gravity = {0.5, 0, 0};
  const Model model = bar_of(scene);
  const State whole = run(model, scene, Method::implicit, 0.01, 6).end;
  State state = run(model, scene, Method::implicit, 0.01, 3).end;
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(model, *backend, state, Method::implicit);
  solver.step(3);
  state = solver.state();
  EXPECT_EQ(state.step, whole.step);
  EXPECT_EQ(state.time, whole.time);
  EXPECT_EQ(state.displacement, whole.displacement);
  EXPECT_EQ(state.velocity, whole.velocity);
}

/// The solver's method of that name takes the whole way in a step.
TEST(Equilibrium, IsAStepOfTheSolver) {
  Scene scene = clamped_bar();
  scene.solver.method = Method::equilibrium;
  scene.gravity = {0.5, 0, 0};
  const Model model = bar_of(scene);
  const auto backend = make_test_backend(model, Precision::double_);
  const StepPlan plan = plan_steps(scene, model, *backend);
  Solver solver(model, *backend, initial_state(model, scene, plan.dt), Method::equilibrium);
  double last = 1;
  solver.observe([&](const NewtonProgress& now) {
    EXPECT_EQ(now.tolerance, 1e-8);  // what is asked where nobody asks for anything else
    last = now.residual;
    return true;
  });
  solver.step();
  EXPECT_GT(last, 1e-8);  // of the step before the last, which ends the search
  EXPECT_LT(last, 0.1);
  // Rest comes after the start: times of frames grow, which viewers order them by.
  EXPECT_EQ(plan.steps, 1);
  EXPECT_EQ(plan.steps_per_frame, 1);
  EXPECT_EQ(solver.time(), 1);
  EXPECT_LE(solver.work().residual, 1e-8);
  EXPECT_GT(solver.work().evaluations, solver.work().newton_steps);
  const State found = solver.state();
  EXPECT_EQ(found.displacement, find_equilibrium(model, *backend).state.displacement);
  EXPECT_EQ(diagnose(model, *backend, solver.now()).kinetic_energy, 0);
}

/// A bar between smooth walls, pulled along x by rollers at its ends: plane strain, whose width
/// shrinks by ν / (1 - ν) of the stretch. Gradients are closed, so that the free faces are free.
TEST(Equilibrium, OnRollersIsPlaneStrain) {
  Scene scene;
  BodyRequest bar;
  bar.name = "bar";
  bar.where = "test";
  bar.source.shape = {.name = "beam",
                      .size = {0.8, 0.4, 0.4},
                      .spacing = 0.1,
                      .placement = ShapeRequest::Placement::nodes,
                      .surface = true};
  bar.material = {.young = 1e6, .poisson = 0.3, .density = 1000, .hourglass = 0.1};
  bar.closure = 1e-6;
  const Axes along_x{.x = true, .y = false, .z = false};
  bar.fixed.push_back({.select = {.all = true}, .axes = {.x = false, .y = false, .z = true}});
  bar.fixed.push_back({.select = {.region = "x-"}, .axes = along_x});
  bar.motions.push_back(
      {.select = {.region = "x+"}, .displacement = {8e-6, 0, 0}, .duration = 1, .axes = along_x});
  scene.bodies.push_back(bar);
  const Model model = build_model(scene);
  const auto backend = make_test_backend(model, Precision::double_);
  const State rest = find_equilibrium(model, *backend).state;
  double top = 0, bottom = 0;
  for (Index i = 0; i < model.size(); ++i) {
    EXPECT_EQ(rest.displacement[i].z, 0);
    const Vec3d& x = model.position[i];
    if (x.y > 0.2 - 1e-9) top = std::max(top, -rest.displacement[i].y);
    if (x.y < -0.2 + 1e-9) bottom = std::max(bottom, rest.displacement[i].y);
  }
  // As far as sums close, 1e-6, and strains of 1e-5 are small.
  EXPECT_NEAR((top + bottom) / 0.4, 1e-5 * 0.3 / 0.7, 1e-4 * 1e-5);
}

/// Stopped anywhere within a step, in either stage, a solver is where that step began, and takes it
/// again to the same bits.
TEST(Implicit, AStoppedStepLeavesTheLastWholeOne) {
  Scene scene = clamped_bar();
  scene.gravity = {0.5, 0, 0};
  const Model model = bar_of(scene);
  const auto backend = make_test_backend(model, Precision::double_);
  Solver whole(model, *backend, initial_state(model, scene, 0.05), Method::implicit);
  whole.step();
  const State before = whole.state();
  int calls = 0;
  whole.observe([&](const NewtonProgress&) { return ++calls > 0; });
  whole.step();
  const State end = whole.state();
  ASSERT_GT(calls, 20);
  for (const double share : {0.1, 0.45, 0.7, 0.95}) {
    const auto other = make_test_backend(model, Precision::double_);
    Solver solver(model, *other, before, Method::implicit);
    int left = static_cast<int>(share * calls);
    solver.observe([&](const NewtonProgress&) { return --left > 0; });
    EXPECT_THROW(solver.step(), InterruptedError);
    EXPECT_EQ(left, 0);  // at once
    const State after = solver.state();
    EXPECT_EQ(after.step, 1);
    EXPECT_TRUE(after.displacement == before.displacement) << share;
    EXPECT_TRUE(after.velocity == before.velocity) << share;
    solver.observe(nullptr);
    solver.step();
    EXPECT_TRUE(solver.state().displacement == end.displacement) << share;
    EXPECT_TRUE(solver.state().velocity == end.velocity) << share;
  }
}

/// Terms so stiff that steps could not be counted are refused by their key.
TEST(Plan, OfAbsurdStiffnessIsRefusedByKey) {
  const auto refusal = [](double volume_stiffness, double hourglass) {
    Scene scene = one_body();
    scene.bodies[0].material.volume_stiffness = volume_stiffness;
    scene.bodies[0].material.hourglass = hourglass;
    const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
    const auto backend = make_test_backend(model, Precision::double_);
    try {
      plan_steps(scene, model, *backend);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("planned");
  };
  EXPECT_THAT(refusal(1e17, 0), ::testing::HasSubstr("body \"body\": volume_stiffness = 1e+17"));
  EXPECT_THAT(refusal(0, 1e5), ::testing::HasSubstr("body \"body\": hourglass = 100000"));
  EXPECT_EQ(refusal(1e8, 10), "planned");  // a thousand times the rubber, a hundred times usual
}

}  // namespace
}  // namespace phyxel
