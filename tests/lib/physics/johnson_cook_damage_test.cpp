/// Johnson and Cook's damage with an energy release rate, at a point.
#include "phyxel/physics/laws/johnson_cook_damage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <string>

#include "support/plastic_points.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;
using Law = JohnsonCookDamage<double>;

/// OFHC copper of Johnson and Cook 1985, by the keys of its parameters, in SI.
struct Copper {
  double young = 124e9, poisson = 0.34, density = 8960, a = 90e6, b = 292e6, n = 0.31, c = 0.025,
         heat = 383, start = 293, melting = 1356, m = 1.09;
  double d1 = 0.54, d2 = 4.89, d3 = -3.03, d4 = 0.014, d5 = 1.12, release = 1e5, spacing = 1e-3;

  operator Material() const {  // NOLINT: tests hand these to what takes materials
    Material all{
        .young = young, .poisson = poisson, .density = density, .law = "johnson-cook-damage"};
    all.spacing = spacing;
    all.parameters = {{"yield_stress", a},
                      {"hardening_modulus", b},
                      {"hardening_exponent", n},
                      {"rate_factor", c},
                      {"specific_heat", heat},
                      {"temperature", start},
                      {"reference_temperature", 293},
                      {"melting_temperature", melting},
                      {"softening_exponent", m},
                      {"d1", d1},
                      {"d2", d2},
                      {"d3", d3},
                      {"d4", d4},
                      {"d5", d5},
                      {"energy_release_rate", release}};
    return all;
  }
  /// The strain at failure as Johnson and Cook write it.
  double failure_strain(double triaxiality, double rate, double temperature) const {
    const double t = std::clamp((temperature - 293) / (melting - 293), 0.0, 1.0);
    return (d1 + d2 * std::exp(d3 * triaxiality)) * (1 + d4 * std::log(std::max(1.0, rate))) *
           (1 + d5 * t);
  }
};
/// A perfectly plastic metal without heat.
const Copper plain{.b = 0, .c = 0, .melting = 0, .d2 = 0, .d4 = 0, .d5 = 0};

/// Adds the flow of a step at a given triaxiality and temperature, and returns the failure strain
/// that it tells.
double told(const Copper& copper, double triaxiality, double rate, double temperature) {
  const Law law = law_of<Law>(copper);
  Law::State state;
  state.temperature_rise = temperature - copper.start;
  const double increment = 1e-4, q = 3e8, bulk = law.lambda + 2.0 / 3 * law.mu;
  const double von_mises = q + 3 * law.mu * increment;
  law.wear(state, triaxiality * q / bulk, von_mises, 1, increment, increment / rate);
  return increment / state.initiation;
}

TEST(JohnsonCookDamage, StrainAtFailureIsTheirs) {
  const Copper copper;
  for (const double triaxiality : {-1.0, -0.33, 0.0, 0.33, 1.0, 2.0}) {
    for (const double rate : {0.01, 1.0, 1e4}) {
      for (const double temperature : {200.0, 293.0, 700.0, 2000.0}) {
        const double strain = copper.failure_strain(triaxiality, rate, temperature);
        EXPECT_NEAR(told(copper, triaxiality, rate, temperature) / strain, 1, 1e-12);
      }
    }
  }
  // Beyond 3 in size the triaxiality counts as 3.
  EXPECT_NEAR(told(copper, 9, 1, 293), copper.failure_strain(3, 1, 293), 1e-12);
  // Copper in simple tension at rest of rate: 0.54 + 4.89 exp(-1.01).
  EXPECT_NEAR(told(copper, 1.0 / 3, 1, 293), 2.321, 5e-4);
}

/// Simple shear of a metal: the flow stress holds until the strain at failure, and the work from
/// there on, times the width of the band, is the energy release rate, at any spacing; damage grows
/// to 1, and the stress to 0.
TEST(JohnsonCookDamage, TearingTakesTheEnergyReleaseRate) {
  for (const double spacing : {1e-4, 1e-3, 4e-3}) {
    for (const double hardening : {0.0, 292e6}) {
      Copper metal = plain;
      metal.spacing = spacing, metal.b = hardening;
      const Law law = law_of<Law>(metal);
      Law::State state;
      M3 f = M3::Identity();
      double begun = 0, last = 0;
      while (state.damage < 1) {
        // Some 1e5 steps: tearing takes a shear of 2 √3 G_c/(ℓ σ_y) = 2e-3 m over the spacing.
        f(0, 1) += 2e-8 / spacing;
        const M3 p = stress_at(law, f, state, 1e-3);
        if (state.initiation < 1) {
          EXPECT_EQ(state.damage, 0);
          begun = law.plastic_work(state);
        } else {
          EXPECT_LE(von_mises_of(p, f),
                    law.flow_stress(state) * (1 - state.damage) * (1 + 1e-9) + 1e-12 * metal.a);
        }
        ASSERT_LT(f(0, 1), 100);
        last = von_mises_of(p, f);
      }
      EXPECT_LE(last, 1e-12 * metal.a);
      const double elastic = state.damage_work;
      const double taken = law.plastic_work(state) - elastic - begun;
      // First order in the steps.
      EXPECT_NEAR(taken * Law::band_width * spacing / metal.release, 1, 3e-3) << spacing;
      // The elastic energy q²/(6 μ) of shear goes, too; q grows with hardening meanwhile.
      const double q = law.flow_stress(state), share = elastic / (q * q / (6 * law.mu));
      EXPECT_LE(share, 1 + 1e-9);
      EXPECT_GE(share, hardening > 0 ? 0.5 : 1 - 1e-9);
    }
  }
}

/// A spent phyxel bears pressure, and neither tension nor shear.
TEST(JohnsonCookDamage, WhatIsSpentBearsPressureAlone) {
  const Law law = law_of<Law>(Copper{});
  const double bulk = law.lambda + 2.0 / 3 * law.mu;
  Deformations any(2);
  for (int k = 0; k < 100; ++k) {
    Law::State state;
    state.damage = 1, state.initiation = 1;
    const M3 f = any.gradient(0.9, 1.1);
    Law::State same = state;
    const M3 p = stress_at(law, f, same, 1e-6), kirchhoff = p * f.transpose();
    const double pressure = bulk * std::min(0.0, std::log(f.determinant()));
    EXPECT_LE(distance(kirchhoff, pressure * M3::Identity()), 1e-12 * bulk);
    EXPECT_LE(distance(p, eigen(law.elastic_stress(grad_u(f), state))), 1e-12 * bulk);
    EXPECT_EQ(same.damage, 1);
  }
}

/// Half damaged: half the stress in tension, half the shear stress under pressure.
TEST(JohnsonCookDamage, DamageTakesItsShareOfTheStress) {
  const Law law = law_of<Law>(Copper{});
  Law::State half;
  half.damage = 0.5;
  for (const double sign : {1.0, -1.0}) {
    M3 f = M3::Identity();
    f(0, 0) += sign * 2e-4, f(0, 1) = 1e-4;  // elastic
    Law::State none, worn = half;
    const M3 whole = stress_at(law, f, none, 1e-6), left = stress_at(law, f, worn, 1e-6);
    EXPECT_NEAR(left(0, 1) / whole(0, 1), 0.5, 1e-3);
    EXPECT_NEAR(left.trace() / whole.trace(), sign > 0 ? 0.5 : 1, 1e-3);
  }
}

/// The law without damage until the strain at failure, to the last bit.
TEST(JohnsonCookDamage, BeginsAsTheLawWithoutIt) {
  const Copper copper;
  Material whole = copper;
  for (const char* name : {"d1", "d2", "d3", "d4", "d5", "energy_release_rate"}) {
    whole.parameters.erase(name);
  }
  const Law law = law_of<Law>(copper);
  const auto other = law_of<JohnsonCook<double>>(whole);
  Law::State state;
  JohnsonCook<double>::State without;
  Deformations any(5);
  M3 f = M3::Identity();
  for (int k = 0; k < 50; ++k) {
    f = ((M3::Identity() + any.noise(0.004)) * f).eval();
    const M3 p = stress_at(law, f, state, 1e-5);
    ASSERT_LT(state.initiation, 1);
    // 1 - d = 1 times moduli that are taken apart and put together again.
    EXPECT_LE(distance(p, stress_at(other, f, without, 1e-5)), 1e-15 * copper.young);
    EXPECT_EQ(state.temperature_rise, without.temperature_rise);
    EXPECT_EQ(state.equivalent_plastic_strain, without.equivalent_plastic_strain);
  }
  EXPECT_GT(state.initiation, 0.01);
}

/// Metal that tears within the deformations of the tests that hold of all laws that flow.
Copper weak() {
  Copper metal;
  metal.d1 = 0.05, metal.d2 = 0.1, metal.release = 2e4;
  return metal;
}
TEST(JohnsonCookDamage, TurningBodiesChangesNothing) {
  expect_rotation_invariance(law_of<Law>(weak()), weak().young, 1e-6);
}
TEST(JohnsonCookDamage, WorkIsStoredOrDissipated) {
  expect_balance_of_work(law_of<Law>(weak()), 1e-3, 5e-3);
}
TEST(JohnsonCookDamage, StressIsTheDerivativeOfTheStoredEnergyAtAFrozenHistory) {
  Copper gigapascal = weak();  // the unit in which the tolerance of differences is stated
  gigapascal.young = 124, gigapascal.a = 0.09, gigapascal.b = 0.292, gigapascal.density = 9e-6;
  gigapascal.release = 1e-3;
  expect_gradient_of_energy(law_of<Law>(gigapascal));
}
TEST(JohnsonCookDamage, LanesOfAPackHaveTheBitsOfScalars) {
  expect_lanes_to_have_the_bits_of_scalars<JohnsonCookDamage, float, 16>(weak(), 1e-5);
  expect_lanes_to_have_the_bits_of_scalars<JohnsonCookDamage, double, 8>(weak(), 1e-5);
  expect_lanes_to_have_the_bits_of_scalars<JohnsonCookDamage, double, 8>(weak(), endless_time);
}
TEST(JohnsonCookDamage, WaveStiffnessIsBounded) {
  Law strong = law_of<Law>(weak());
  strong.yield_stress = 1e15;
  expect_wave_bound(law_of<Law>(weak()), strong);
}

TEST(JohnsonCookDamage, RefusesWhatCannotBeAndSaysWhy) {
  EXPECT_EQ(law_refusal(Copper{}), "");
  Copper none;
  none.d1 = none.d2 = 0;
  EXPECT_THAT(law_refusal(none), HasSubstr("allowed: d1 + d2 > 0"));
  Copper coarse;  // stores A²/(2 E) = 33 kJ/m³ over 2 m
  coarse.release = 1e4, coarse.spacing = 1;
  EXPECT_THAT(law_refusal(coarse), HasSubstr("energy_release_rate of at least 1.5 yield_stress^2"));
  Material m = Copper{};
  m.parameters.erase("energy_release_rate");
  EXPECT_THAT(law_refusal(m), HasSubstr("energy_release_rate is missing"));
  m = Copper{};
  m.parameters["energy_release_rate"] = 0;
  EXPECT_THAT(law_refusal(m), HasSubstr("energy_release_rate = 0 found; allowed: "));
}

}  // namespace
}  // namespace phyxel
