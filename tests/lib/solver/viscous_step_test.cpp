/// Kelvin–Voigt damping lowers the largest stable step.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/step_control.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;
using ::testing::Not;

/// How far a mode of frequency ω goes that a relaxation time damps, in 4000 of Verlet's steps,
/// where viscous forces follow from half-step velocities.
double amplitude_after(double omega, double relaxation_time, double dt) {
  double u = 1, v = 0, largest = 0;
  for (int s = 0; s < 4000; ++s) {
    v -= dt * omega * omega * (u + relaxation_time * v);
    u += dt * v;
    if (s > 3000 || !std::isfinite(u))
      largest = std::isfinite(u) ? std::max(largest, std::abs(u)) : HUGE_VAL;
  }
  return largest;
}

TEST(ViscousStep, IsTheLargestAtWhichAModeDiesAway) {
  const double omega = 50;
  for (const double damping : {0.0, 1e-3, 0.1, 1.0, 30.0}) {  // ξ, of critical damping
    const double relaxation_time = 2 * damping / omega;
    const double limit = stable_step(omega, relaxation_time);
    EXPECT_NEAR(limit, 2 / omega * (std::sqrt(1 + damping * damping) - damping), 1e-12 / omega)
        << damping;
    EXPECT_LT(amplitude_after(omega, relaxation_time, 0.99 * limit), 50) << damping;
    EXPECT_GT(amplitude_after(omega, relaxation_time, 1.01 * limit), 1e3) << damping;
  }
}

/// Without cancellation: beyond critical damping it is 1 / (2ξ).
TEST(ViscousStep, KeepsItsDigitsUnderStrongDamping) {
  EXPECT_NEAR(viscous_step_share(2e9, 1) * 2e9, 1, 1e-15);
  EXPECT_EQ(viscous_step_share(0, 1), 1);
}

Model block(double relaxation_time) {
  Scene scene = one_body();
  scene.bodies[0].material.viscosity = relaxation_time;
  return model_of(scene, lattice(4, 4, 4, 0.1));
}

/// The step limit of a model, and so the step of a plan, follow from its longest relaxation time.
TEST(ViscousStep, IsThatOfAPlan) {
  const Model elastic = block(0);
  const StepLimit without = step_limit(elastic, 1);
  const double relaxation_time = 1 / without.omega_max;  // ξ = 1/2
  const Model model = block(relaxation_time);
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const double share = std::sqrt(1.25) - 0.5;
  EXPECT_NEAR(largest_viscosity(model), relaxation_time, 1e-18);
  EXPECT_NEAR(step_limit(model, *backend).largest_step, share * without.largest_step,
              1e-9 * without.largest_step);
  Scene scene = one_body();
  scene.output.frames_per_second = 0;
  const StepPlan plan = plan_steps(scene, model, *backend);
  // Three digits of 0.8 of the limit, cut so that the end falls on a whole step.
  EXPECT_LE(plan.dt, 0.8 * share * without.largest_step);
  EXPECT_GT(plan.dt, 0.78 * share * without.largest_step);
  // The plan says by how much: √1.25 - 0.5 = 0.618.
  EXPECT_THAT(plan.why, HasSubstr("viscosity"));
  EXPECT_THAT(plan.why, HasSubstr("shortens it to 0.618 x 2 / omega_max"));
  EXPECT_THAT(plan_steps(scene, elastic, *make_test_backend(elastic, Precision::double_, 1)).why,
              Not(HasSubstr("viscosity")));
}

/// The viscosity of a stretched body grows as the stretch squared, though a linear law does not
/// stiffen: beyond its limit a step is halved, where an elastic body keeps it.
TEST(ViscousStep, IsHalvedWhereAViscousBodyStretches) {
  Scene scene = one_body();
  scene.bodies[0].material.law = "small-strain";
  for (const bool viscous : {false, true}) {
    const Cloud cloud = lattice(4, 4, 4, 0.1);
    scene.bodies[0].material.viscosity = 0;
    const double omega = step_limit(model_of(scene, cloud), 1).omega_max;
    scene.bodies[0].material.viscosity = viscous ? 2 / omega : 0;
    const Model model = model_of(scene, cloud);
    EXPECT_EQ(stiffens(model.parts[0].material), viscous);
    const auto backend = make_test_backend(model, Precision::double_, 1);
    StepPlan plan;
    plan.limit = step_limit(model, 1);
    plan.dt = 0.8 * plan.limit.largest_step;
    plan.shortens = true;
    State state = initial_state(model, scene, plan.dt);
    for (Index i = 0; i < model.size(); ++i) {
      state.displacement[i] = {0.5 * model.position[i].x, 0, 0};  // half as long again
    }
    Solver solver(model, *backend, state, Method::verlet);
    StepControl control(model, *backend, plan);
    EXPECT_NEAR(find_stiffening(model, *backend).ratio, viscous ? 2.25 : 1, 1e-9);
    EXPECT_EQ(control.look(solver, 0), viscous ? 1 : 0);
    if (!viscous) continue;
    // Where a linear body is stretched, its frequencies are as at rest, and its damping is
    // 2.25 times that: 0.8 dt of the limit at rest, now a half of it, against the limit there.
    const double now = stable_step(omega, 2.25 * 2 / omega);
    EXPECT_NEAR(solver.looks().measured_share, std::pow(solver.dt() / now, 2),
                0.1 * solver.looks().measured_share);  // the limit is found to 2%
  }
}

}  // namespace
}  // namespace phyxel
