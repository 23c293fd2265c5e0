/// The generalised Maxwell solid at a point: relaxation, storage and loss, heat.
#include "phyxel/physics/laws/maxwell.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>

#include "support/plastic_points.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;
using Law = Maxwell<double>;

constexpr double young = 10, poisson = 0.3;
constexpr double shear = young / (2 * (1 + poisson));

Material material(ParameterValue::Curve relaxation) {
  Material m{.young = young, .poisson = poisson, .law = "maxwell"};
  m.parameters = {{"relaxation", relaxation}};
  return m;
}
const ParameterValue::Curve one = {{0.1, 0.6}};
const ParameterValue::Curve three = {{0.02, 0.3}, {0.3, 0.2}, {5, 0.25}};
const ParameterValue::Curve four = {{0.02, 0.3}, {0.3, 0.2}, {5, 0.25}, {80, 0.1}};

/// The deviator of the Kirchhoff stress P Fᵀ.
M3 deviator_of(const M3& p, const M3& f) {
  const M3 tau = p * f.transpose();
  return tau - tau.trace() / 3 * M3::Identity();
}
double pressure_of(const M3& p, const M3& f) { return -(p * f.transpose()).trace() / 3; }
/// ln V of F = V R.
M3 logarithm_of(const M3& f) {
  const Eigen::SelfAdjointEigenSolver<M3> solver(f * f.transpose());
  return solver.eigenvectors() * (0.5 * solver.eigenvalues().array().log()).matrix().asDiagonal() *
         solver.eigenvectors().transpose();
}

/// The share of the shear modulus that is left after a time at a fixed deformation.
double left_after(const ParameterValue::Curve& branches, double time) {
  double left = 1;
  for (const auto& [tau, share] : branches) left -= share * (1 - std::exp(-time / tau));
  return left;
}

/// σ(t)/σ(0) = g_∞ + Σ g_m e^{-t/τ_m} of the deviator at any stretch, in steps of any size; the
/// pressure stays.
TEST(Maxwell, RelaxesAsTheSeriesDoes) {
  Deformations any(1);
  for (const auto& branches : {one, three, four}) {
    const Law law = law_of<Law>(material(branches));
    for (int k = 0; k < 20; ++k) {
      const M3 f = any.gradient(0.6, 1.8);
      const M3 first = 2 * shear * logarithm_of(f);
      const M3 deviator = first - first.trace() / 3 * M3::Identity();
      Law::State state;
      double time = 0;
      for (const double dt : {0.0, 1e-4,  // at first a sudden stretch
                              0.01, 0.05, 0.3, 3.0, 40.0}) {
        time += dt;
        const M3 p = stress_at(law, f, state, dt);
        // Rounding of strains of 1 times E, magnified by stretches up to five times each other.
        EXPECT_LE(distance(deviator_of(p, f), left_after(branches, time) * deviator),
                  3e-12 * young);
        const double bulk = young / (3 * (1 - 2 * poisson));
        EXPECT_NEAR(pressure_of(p, f), -bulk * std::log(f.determinant()), 1e-12 * young);
      }
    }
  }
}

/// An endless time leaves the spring that stays, whatever has been before.
TEST(Maxwell, IsElasticAtRest) {
  Deformations any(2);
  const Law law = law_of<Law>(material(three));
  const Hencky<double> lasting{law.lambda, law.mu};
  EXPECT_NEAR(lasting.mu, 0.25 * shear, 1e-15 * young);
  EXPECT_NEAR(lasting.lambda + 2.0 / 3 * lasting.mu, young / (3 * (1 - 2 * poisson)),
              1e-14 * young);
  Law::State state;
  for (int k = 0; k < 100; ++k) {
    const M3 f = any.gradient(0.6, 1.6);
    const M3 p = stress_at(law, f, state, k % 2 == 0 ? endless_time : 1e9);
    EXPECT_LE(distance(p, eigen(lasting.first_piola_stress(grad_u(f)))), 1e-12 * young);
    EXPECT_NEAR(law.energy(grad_u(f), state), lasting.energy(grad_u(f)), 1e-12 * young);
  }
}

/// Under γ sin ωt the stress is that of the complex modulus g_∞ + Σ g_m iωτ_m/(1 + iωτ_m).
TEST(Maxwell, StoresAndLosesAsTheSeriesDoes) {
  const Law law = law_of<Law>(material(three));
  for (const double omega : {0.1, 1.0, 10.0, 100.0}) {
    std::complex<double> modulus = 1;
    for (const auto& [tau, share] : three) {
      modulus -= share / std::complex<double>(1, omega * tau);
    }
    constexpr int steps = 4000, cycles = 25;
    constexpr double small = 1e-6;
    const double dt = 2 * M_PI / omega / steps;
    Law::State state;
    std::complex<double> seen;  // in the last cycle; what is left of the first ones changes slowly
    for (int c = 0; c < cycles; ++c) {
      seen = 0;
      for (int k = 1; k <= steps; ++k) {
        const double phase = 2 * M_PI * k / steps;
        M3 f = M3::Identity();
        f(0, 1) = small * std::sin(phase);
        const double stress = stress_at(law, f, state, dt)(0, 1);
        seen += 2.0 / steps * stress / (small * shear) *
                std::complex<double>(std::sin(phase), std::cos(phase));
      }
    }
    // First order in Δt/τ: ω Δt/2 of the loss, 8e-4.
    EXPECT_NEAR(seen.real(), modulus.real(), 0.01 * modulus.real()) << omega;
    EXPECT_NEAR(seen.imag(), modulus.imag(), 0.01 * modulus.imag()) << omega;
  }
}

/// At a fixed deformation, all energy that springs lose is heat.
TEST(Maxwell, HeatIsWhatSpringsLose) {
  Deformations any(3);
  const Law law = law_of<Law>(material(four));
  for (int k = 0; k < 20; ++k) {
    Law::State state;
    const M3 f = any.gradient(0.6, 1.7);
    stress_at(law, f, state, 0);  // a sudden stretch
    EXPECT_EQ(state.relaxation_work, 0);
    double stored = law.energy(grad_u(f), state);
    const double all = stored;
    for (const double dt : {0.01, 0.1, 1.0, 10.0, endless_time}) {
      const double before = state.relaxation_work;
      stress_at(law, f, state, dt);
      const double now = law.energy(grad_u(f), state);
      EXPECT_GT(state.relaxation_work, before);
      EXPECT_NEAR(now + state.relaxation_work, all, 1e-13 * young);
      EXPECT_LT(now, stored);
      stored = now;
    }
  }
}
/// Heat is that of the forces at the ends of steps: the balance is of second order in the step, but
/// where strains at its ends are not coaxial.
TEST(Maxwell, WorkIsStoredOrBecomesHeat) {
  expect_balance_of_work(law_of<Law>(material(one)), 1, 1e-4);
  expect_balance_of_work(law_of<Law>(material(three)), 1, 1e-4);
}
/// A slow deformation, whose dashpots follow at once, makes no heat: springs of branches carry
/// nothing.
TEST(Maxwell, WithoutHeatComesToRest) {
  const Law law = law_of<Law>(material(three));
  Law::State state;
  for (const double stretch : {1.2, 0.8, 1.5}) {
    stress_at(law, V3(stretch, 1, 1).asDiagonal(), state, endless_time);
  }
  EXPECT_EQ(state.relaxation_work, 0);
}
TEST(Maxwell, TurningBodiesChangesNothing) {
  expect_rotation_invariance(law_of<Law>(material(three)), young, 1e-2);
}
TEST(Maxwell, StressIsTheDerivativeOfTheStoredEnergyAtAFrozenHistory) {
  expect_gradient_of_energy(law_of<Law>(material(four)));
}
TEST(Maxwell, LanesOfAPackHaveTheBitsOfScalars) {
  expect_lanes_to_have_the_bits_of_scalars<Maxwell, float, 16>(material(three), 0.01);
  expect_lanes_to_have_the_bits_of_scalars<Maxwell, double, 8>(material(three), 0.01);
  expect_lanes_to_have_the_bits_of_scalars<Maxwell, double, 8>(material(one), 0);
  expect_lanes_to_have_the_bits_of_scalars<Maxwell, double, 8>(material(one), endless_time);
}

/// Two branches of one relaxation time are one of both shares.
TEST(Maxwell, BranchesAdd) {
  Deformations any(4);
  const Law whole = law_of<Law>(material({{0.1, 0.6}}));
  const Law parts = law_of<Law>(material({{0.1, 0.25}, {0.1 * (1 + 1e-15), 0.35}}));
  Law::State a, b;
  for (int k = 0; k < 100; ++k) {
    const M3 f = any.gradient(0.7, 1.4);
    EXPECT_LE(distance(stress_at(whole, f, a, 0.03), stress_at(parts, f, b, 0.03)), 1e-12 * young);
  }
}

/// The bound of wave speeds holds in bodies that have relaxed stretched and were then compressed as
/// much, and the reverse.
TEST(Maxwell, WaveStiffnessIsBounded) {
  Deformations any(5);
  const Law law = law_of<Law>(material({{0.1, 0.9}}));
  for (int k = 0; k < 60; ++k) {
    Law::State state;
    const M3 f = any.gradient(0.6, 1.6);
    // Every other body has relaxed at the opposite strain, the others at any of up to a quarter.
    const M3 before = k % 2 == 0 ? M3(f.inverse()) : any.gradient(0.8, 1.25);
    stress_at(law, before, state, endless_time);
    const double bound = law.wave_stiffness(principal_stretches(grad_u(f)));
    for (const double dt : {1e-9, 1e-3, 1.0}) {
      const auto stress = [&](const M3& at) {
        Law::State same = state;
        return stress_at(law, at, same, dt);
      };
      // Central differences at 1e-5 leave 1e-8.
      EXPECT_GE(bound, largest_wave_stiffness(stress, f, any) * (1 - 1e-6));
    }
  }
}

TEST(Maxwell, RefusesWhatCannotBeAndSaysWhy) {
  EXPECT_EQ(law_refusal(material(four)), "");
  EXPECT_THAT(law_refusal(material({{0.1, 0.5}, {1, 0.5}})),
              HasSubstr("shares of relaxation that add up to less than 1"));
  EXPECT_THAT(law_refusal(material({{0, 0.5}})),
              HasSubstr("relaxation: point 1 is [0, 0.5]; allowed: [[x, y], ...], 1 to 4 points, x "
                        "(relaxation time) ascends from above 0"));
  EXPECT_THAT(law_refusal(material({{0.1, 0}})), HasSubstr("1e-06 <= y <= 1"));
  EXPECT_THAT(law_refusal(material({{1, 0.1}, {0.1, 0.1}})), HasSubstr("point 2 is [0.1, 0.1]"));
  EXPECT_THAT(law_refusal(material({{1, .1}, {2, .1}, {3, .1}, {4, .1}, {5, .1}})),
              HasSubstr("5 points found"));
}

}  // namespace
}  // namespace phyxel
