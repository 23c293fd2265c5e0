/// Johnson and Cook's flow stress with its heating, at a point.
#include "phyxel/physics/laws/johnson_cook.hpp"

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
using Law = JohnsonCook<double>;

/// OFHC copper of Johnson and Cook 1983, by the keys of its parameters, in SI.
struct Copper {
  double young = 124e9, poisson = 0.34, density = 8960, a = 90e6, b = 292e6, n = 0.31, c = 0.025,
         rate = 1, heat = 383, fraction = 0.9, start = 293, reference = 293, melting = 1356,
         m = 1.09;

  operator Material() const {  // NOLINT: tests hand these to what takes materials
    Material all{.young = young, .poisson = poisson, .density = density, .law = "johnson-cook"};
    all.parameters = {{"yield_stress", a},
                      {"hardening_modulus", b},
                      {"hardening_exponent", n},
                      {"rate_factor", c},
                      {"reference_rate", rate},
                      {"specific_heat", heat},
                      {"heat_fraction", fraction},
                      {"temperature", start},
                      {"reference_temperature", reference},
                      {"melting_temperature", melting},
                      {"softening_exponent", m}};
    return all;
  }
  /// The flow stress as Johnson and Cook write it [Pa].
  double flow_stress(double strain, double strain_rate, double rise) const {
    const double t = std::clamp((start + rise - reference) / (melting - reference), 0.0, 1.0);
    const double softening = melting > 0 ? 1 - std::pow(t, m) : 1;
    return (a + b * std::pow(strain, n)) * (1 + c * std::log(std::max(1.0, strain_rate / rate))) *
           softening;
  }
};
/// Copper without heat, so that its flow stress is known beforehand.
const Copper cold{.melting = 0};

TEST(Powers, AreThoseOfTheStandardLibrary) {
  Deformations any(1);
  for (int k = 0; k < 20000; ++k) {
    const double x = std::exp(any.uniform(-80, 80)), p = any.uniform(0.01, 2);
    EXPECT_NEAR(log_of(x), std::log(x), 4 * 2.2e-16 * std::max(1.0, std::abs(std::log(x))));
    const auto single = static_cast<float>(x);
    EXPECT_NEAR(log_of(single), std::log(single),
                5e-7 * std::max(1.0F, std::abs(std::log(single))));
    const double y = std::exp(any.uniform(-20, 3));
    // A logarithm of up to 40 has a rounding of 7e-15, which becomes a relative one of the power;
    // exp(-y) has one of 5e-16 beside 1, which counts where its inverse is taken.
    const double power = std::pow(y, p);
    EXPECT_NEAR(power_of(y, p), power, 3e-15 * std::max(1.0, power) + 5e-16 * power * power);
  }
  EXPECT_EQ(log_of(1.0), 0);
  EXPECT_EQ(power_of(1.0, 0.3), 1);
}

TEST(JohnsonCook, UniaxialCyclesAreTheClosedForm) {
  for (const double rate : {0.5, 1.0, 1e3, 1e6}) {
    const Law law = law_of<Law>(cold);
    // 100 steps of each stretch of plastic flow, up to 0.5: the rates below, of the smallest of
    // them to 25 times.
    const double dt = 0.02 / 100 / rate;
    expect_uniaxial_cycles(
        law, cold.young, cold.poisson, dt,
        [&](double e, double increment, double step) {
          return cold.flow_stress(e, increment / step, 0);
        },
        [](const auto&, double, double) {});
  }
}

/// The ratio of the flow stresses at 1000/s and 1/s is 1 + 0.025 ln 1000.
TEST(JohnsonCook, RateRaisesTheStressByItsLogarithm) {
  const Law law = law_of<Law>(cold);
  const auto stress_at_rate = [&](double rate) {
    Law::State state;
    double stress = 0;
    for (int k = 1; k <= 200; ++k) {
      // Stretch at a steady rate, sides by the plastic incompressibility that flow gives them.
      const double along = 1e-3 * k, tau = stress;
      const double across = -cold.poisson * tau / cold.young - (along - tau / cold.young) / 2;
      const M3 f = V3(std::exp(along), std::exp(across), std::exp(across)).asDiagonal();
      stress = von_mises_of(stress_at(law, f, state, 1e-3 / rate), f);
    }
    return std::array{stress, state.equivalent_plastic_strain};
  };
  const auto slow = stress_at_rate(1), fast = stress_at_rate(1e3);
  // Both at the strain of the slow one: the elastic strain of the fast one is larger by 4e-4, and
  // hardening by 292 MPa n ε^(n-1) of it is 1e-4 of the stress.
  const double hardening =
      (cold.a + cold.b * std::pow(slow[1], cold.n)) / (cold.a + cold.b * std::pow(fast[1], cold.n));
  EXPECT_NEAR(fast[0] / slow[0] * hardening, 1.1727, 1e-4);
}

/// Adiabatic heating against the integral of the flow stress, by an own integration of
/// dT/dε̄ = χ σ_y(ε̄, rate, T)/(ρ c_p) in ten times as many steps of fourth order.
TEST(JohnsonCook, HeatsByTheIntegralOfItsPlasticWork) {
  const Copper copper;
  const Law law = law_of<Law>(copper);
  const double rate = 1e4, last = 2.0;
  const auto rise_in = [&](int steps) {
    Law::State state;
    for (int k = 1; k <= steps; ++k) {
      const double increment = last / steps;
      state.equivalent_plastic_strain += 0;
      law.remember(state, 1, increment, increment / rate);
    }
    return state.temperature_rise;
  };
  const auto slope = [&](double e, double t) {
    return copper.fraction * copper.flow_stress(e, rate, t) / (copper.density * copper.heat);
  };
  double expected = 0;
  const int fine = 20000;
  for (int k = 0; k < fine; ++k) {
    // The strain goes with the third power of the parameter, which resolves the steep start.
    const auto strain = [&](double s) { return last * s * s * s; };
    const double from = strain(double(k) / fine), to = strain((k + 1.0) / fine),
                 middle = strain((k + 0.5) / fine), h = to - from;
    const double one = slope(from, expected), two = slope(middle, expected + (middle - from) * one),
                 three = slope(middle, expected + (middle - from) * two),
                 four = slope(to, expected + h * three);
    (void)four;
    // Simpson's rule in the parameter, with the middle where it is in strain.
    const double s = (middle - from) / h;
    const double w_middle = 1 / (6 * s * (1 - s)), w_to = (2 - 3 * s) / (6 * (1 - s)),
                 w_from = 1 - w_middle - w_to;
    expected += h * (w_from * one + w_middle * 0.5 * (two + three) + w_to * four);
  }
  EXPECT_GT(expected, 200);  // K
  // The temperature within a step is that of its start: first order in the step.
  EXPECT_NEAR(rise_in(2000) / expected, 1, 1e-3);
  EXPECT_NEAR(rise_in(20000) / expected, 1, 1e-4);
  EXPECT_GT((rise_in(2000) / expected - 1) / (rise_in(20000) / expected - 1), 5);
}

/// Whatever the rate, the temperature and the size of the step: nine Newton steps reach it.
TEST(JohnsonCook, EndsOnTheYieldSurfaceAfterStepsOfAnySize) {
  for (const double dt : {endless_time, 1e-9, 1e-6, 1e-2, 10.0}) {
    Copper copper;
    copper.heat = 4e4;  // trial strains of 1 would melt copper at once
    expect_yield_surface(
        law_of<Law>(copper), dt, [&](const auto& s, double increment, double warm) {
          return copper.flow_stress(s.equivalent_plastic_strain, increment / dt, warm);
        });
  }
}

/// Materials and states at random: the scalar equation holds to rounding after nine steps.
TEST(JohnsonCook, SolvesItsScalarEquation) {
  Deformations any(4);
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    Copper p;
    p.poisson = 0.3;
    p.a = p.young * std::pow(10, any.uniform(-4, -1)),
    p.b = p.young * std::pow(10, any.uniform(-4, -0.5));
    p.n = any.uniform(0.05, 1.5), p.c = k % 5 == 0 ? 0 : std::pow(10, any.uniform(-3, -0.5));
    p.melting = 0;
    const Law law = law_of<Law>(p);
    Law::State state;
    state.equivalent_plastic_strain = k % 4 == 0 ? 0 : std::pow(10, any.uniform(-6, 1));
    const double dt = k % 7 == 0 ? endless_time : std::pow(10, any.uniform(-14, -1));
    const double excess = p.a * std::pow(10, any.uniform(-9, 2)), mu = law.mu;
    const double x = law.plastic_increment(excess, state, dt), begin = law.flow_stress(state);
    Law::State after = state;
    after.equivalent_plastic_strain += x;
    const double rate = std::max(1.0, x / dt);
    const double end = law.flow_stress(after) * (1 + p.c * std::log(rate));
    worst = std::max(worst, std::abs(3 * mu * x + end - begin - excess) / (end + excess));
    ASSERT_GE(x, 0);
  }
  // Stresses of which the trial's is up to 100 times the flow stress; seen: 7e-13.
  EXPECT_LE(worst, 1e-11);
}

TEST(JohnsonCook, FloatsSolveItToo) {
  Deformations any(4);
  for (int k = 0; k < 5000; ++k) {
    const auto law = law_of<JohnsonCook<float>>(cold);
    JohnsonCook<float>::State state;
    state.equivalent_plastic_strain = static_cast<float>(k % 4 == 0 ? 0 : any.uniform(0, 2));
    const auto dt = static_cast<float>(std::pow(10, any.uniform(-9, -1)));
    const auto excess = static_cast<float>(cold.a * std::pow(10, any.uniform(-3, 1)));
    const double x = law.plastic_increment(excess, state, dt), e = state.equivalent_plastic_strain;
    const double begin = law.flow_stress(state), rate = x / static_cast<double>(dt);
    // Below a strain of 1e-6, the power is a line.
    const double share = std::min(1.0, (e + x) / 1e-6);
    const double slow = cold.a + share * (cold.flow_stress(std::max(e + x, 1e-6), 0, 0) - cold.a);
    const double end = slow * (1 + cold.c * std::log(std::max(1.0, rate)));
    // A rounding of ε̄ of 1 is 6e-8, of 3 μ Δε̄ up to 1e-6 of the sum of all.
    EXPECT_NEAR((3 * static_cast<double>(law.mu) * x + end - begin - excess) / (end + excess), 0,
                4e-6);
  }
}

/// Near the melting temperature heating slows down with the flow stress, and never passes it;
/// molten metal has no strength and no work.
TEST(JohnsonCook, MeltsWithoutStrength) {
  Copper hot;
  hot.start = 1300;
  const Law law = law_of<Law>(hot);
  Law::State state, molten;
  molten.temperature_rise = 2000;
  M3 f = M3::Identity();
  for (int k = 0; k < 400; ++k) {
    f(0, 1) += 0.01;
    stress_at(law, f, state, 1e-6);
    EXPECT_LT(state.temperature_rise, hot.melting - hot.start);
    // Rounding of a trial stress of E times a shear of 0.01.
    EXPECT_LE(von_mises_of(stress_at(law, f, molten, 1e-6), f), 1e-12 * hot.young);
    EXPECT_EQ(molten.temperature_rise, 2000);
  }
  EXPECT_GT(state.temperature_rise, 0.2 * (hot.melting - hot.start));
}

TEST(JohnsonCook, TurningBodiesChangesNothing) {
  expect_rotation_invariance(law_of<Law>(Copper{}), Copper{}.young, 1e-6);
}
TEST(JohnsonCook, WorkIsStoredOrDissipated) { expect_balance_of_work(law_of<Law>(Copper{}), 1e-3); }
TEST(JohnsonCook, StressIsTheDerivativeOfTheStoredEnergyAtAFrozenHistory) {
  Copper gigapascal;  // the unit in which the tolerance of differences is stated
  gigapascal.young = 124, gigapascal.a = 0.09, gigapascal.b = 0.292, gigapascal.density = 9e-6;
  expect_gradient_of_energy(law_of<Law>(gigapascal));
}
TEST(JohnsonCook, LanesOfAPackHaveTheBitsOfScalars) {
  expect_lanes_to_have_the_bits_of_scalars<JohnsonCook, float, 16>(Copper{}, 1e-5);
  expect_lanes_to_have_the_bits_of_scalars<JohnsonCook, double, 8>(Copper{}, 1e-5);
  expect_lanes_to_have_the_bits_of_scalars<JohnsonCook, double, 8>(Copper{}, endless_time);
}
TEST(JohnsonCook, WaveStiffnessIsBounded) {
  Law strong = law_of<Law>(Copper{});
  strong.yield_stress = 1e15;
  expect_wave_bound(law_of<Law>(Copper{}), strong);
}

TEST(JohnsonCook, RefusesWhatCannotBeAndSaysWhy) {
  EXPECT_EQ(law_refusal(Copper{}), "");
  EXPECT_EQ(law_refusal(cold), "");
  const auto refusal = [](const char* name, double value) {
    Material m = Copper{};
    m.parameters[name] = value;
    return law_refusal(m);
  };
  struct Case {
    const char* name;
    double value;
    const char* found;
  };
  for (const auto& [name, value, found] : {Case{"yield_stress", 0, "yield_stress = 0"},
                                           {"hardening_modulus", -1, "hardening_modulus = -1"},
                                           {"hardening_exponent", 0, "hardening_exponent = 0"},
                                           {"rate_factor", -0.1, "rate_factor = -0.1"},
                                           {"reference_rate", 0, "reference_rate = 0"},
                                           {"specific_heat", 0, "specific_heat = 0"},
                                           {"heat_fraction", 1.1, "heat_fraction = 1.1"},
                                           {"temperature", -3, "temperature = -3"},
                                           {"softening_exponent", 0, "softening_exponent = 0"}}) {
    const std::string text = refusal(name, value);
    EXPECT_THAT(text, HasSubstr(std::string(found) + " found; allowed: ")) << text;
    EXPECT_THAT(text, HasSubstr(std::string("<= ") + name + " <=")) << text;
  }
  EXPECT_THAT(refusal("melting_temperature", 280), HasSubstr("melting_temperature = 280"));
  EXPECT_THAT(refusal("melting_temperature", 280),
              HasSubstr("allowed: melting_temperature = 0, or melting_temperature > reference"));
  Material m = Copper{};
  m.parameters.erase("specific_heat");
  EXPECT_THAT(law_refusal(m), HasSubstr("specific_heat is missing, which law \"johnson-cook\""));
  m = Copper{};
  m.density = 0;
  EXPECT_THAT(law_refusal(m), HasSubstr("density = 0 found; allowed: 0 < density < 1e+18"));
}

}  // namespace
}  // namespace phyxel
