/// Thermal expansion by a given temperature, at a point.
#include "phyxel/physics/laws/expansion.hpp"

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

constexpr double young = 200, poisson = 0.3, expansion = 1e-4;

Material warm(const std::string& law, std::vector<std::array<double, 2>> curve) {
  Material m = rubber_of(law);
  m.young = young, m.poisson = poisson;
  m.expansion = expansion;
  m.temperature_curve = std::move(curve);
  return m;
}
/// A law of the list that expands, with the constants of a material.
template <class Law>
ExpandingLaw<Law, double> expanding(Material material) {
  material.law = Law::name;
  const ChosenLaw chosen = chosen_law(material);
  const double* const constants = chosen.constants.data();
  return expanding_law<double>(make_law<Law, double>(constants),
                               constants + constants_of_law<Law, double>);
}
/// Metal that yields at a strain of 1/2000.
Material metal(std::vector<std::array<double, 2>> curve) {
  Material m = warm("j2", std::move(curve));
  m.parameters = {{"yield_stress", 0.1}, {"hardening", 1.0}};
  return m;
}

/// Linear between the points, constant before the first and after the last.
TEST(Expansion, TheThermalStrainFollowsTheCurve) {
  const std::array<double, 2> curve[] = {{1, 50}, {2, -30}, {2.5, 10}, {7, 10}};
  const auto strain = make_law<ThermalStrain<double>, double>(
      ThermalStrain<double>::constants(expansion, curve).data());
  const auto expect = [&](double time, double change) {
    EXPECT_NEAR(strain.at(time), expansion * change, 1e-17) << time;  // a rounding of 5e-3
  };
  expect(0, 50), expect(1, 50), expect(1.5, 10), expect(2, -30), expect(2.25, -10);
  expect(2.5, 10), expect(5, 10), expect(7, 10), expect(1e30, 10);
  const std::array<double, 2> always[] = {{0, 80}};
  const auto steady = make_law<ThermalStrain<float>, float>(
      ThermalStrain<double>::constants(expansion, always).data());
  EXPECT_EQ(steady.at(3.0F), static_cast<float>(expansion * 80));
}

/// A million steps of a float: without the rest that rounding leaves, the time is off by 1%.
TEST(Expansion, FloatsCountTheTimeOfManySteps) {
  const Material m = warm("neo-hookean", {{0, 0}, {1, 500}});
  const ChosenLaw chosen = chosen_law(m);
  const auto law =
      expanding_law<float>(make_law<NeoHookean<float>, float>(chosen.constants.data()),
                           chosen.constants.data() + constants_of_law<NeoHookean<float>, float>);
  ExpandingLaw<NeoHookean<float>, float>::State state;
  const float dt = 9.1e-7F;
  for (int k = 0; k < 1000000; ++k) law.first_piola_stress(Mat3<float>{}, state, dt);
  const double time = 1e6 * static_cast<double>(dt);
  EXPECT_NEAR(state.heat.time, time, 1e-6);  // some roundings of 1
  EXPECT_NEAR(state.heat.thermal_strain, expansion * 500 * time, 1e-7);
}

/// A body that is free to expand has no stress and no energy, whatever its law, temperature and
/// turn.
TEST(Expansion, FreeBodiesExpandWithoutStress) {
  Deformations any(1);
  Laws::for_each<double>([&]<class Law>(std::type_identity<Law>) {
    // Rounding of stresses and energies of a strain of 0.1, of rubber's moduli where E is no
    // parameter.
    const double modulus = has_parameter(Law::name, "young") ? young : 1e5;
    for (const double change : {-400.0, 3.0, 900.0}) {
      const auto law = expanding<Law>(warm(Law::name, {{0, change}}));
      typename ExpandingLaw<Law, double>::State state;
      M3 f = (1 + expansion * change) * M3::Identity();
      if (Law::name != std::string("small-strain")) f = any.rotation() * f;
      EXPECT_LE(stress_at(law, f, state, 0).cwiseAbs().maxCoeff(), 1e-14 * modulus) << Law::name;
      EXPECT_NEAR(law.energy(grad_u(f), state), 0, 1e-15 * modulus) << Law::name;
      EXPECT_EQ(law.viscous_work(state), 0);
    }
  });
}

/// A body that is held in all directions bears the pressure 3 K α ΔT, one that is held along a bar
/// E α ΔT, and one held in a plane E α ΔT/(1 - ν): to first order in α ΔT = 1e-6.
TEST(Expansion, HeldBodiesBearTheStressOfTheLoss) {
  const double change = 0.01, strain = expansion * change;
  Laws::for_each<double>([&]<class Law>(std::type_identity<Law>) {
    if (!has_parameter(Law::name, "young")) return;
    Material m = warm(Law::name, {{0, change}});
    if (m.parameters.contains("yield_stress")) m.parameters["yield_stress"] = 1e3;
    const auto law = expanding<Law>(m);
    const auto stress = [&](double across_y, double across_z) {
      typename ExpandingLaw<Law, double>::State state;
      M3 f = M3::Identity();
      f(1, 1) += across_y, f(2, 2) += across_z;
      return stress_at(law, f, state, 0);
    };
    const double tolerance = 1e-5 * young * strain;
    const M3 all = stress(0, 0);
    EXPECT_NEAR(all(0, 0), -young / (1 - 2 * poisson) * strain, tolerance) << Law::name;
    const M3 bar = stress((1 + poisson) * strain, (1 + poisson) * strain);
    EXPECT_NEAR(bar(0, 0), -young * strain, tolerance) << Law::name;
    EXPECT_NEAR(bar(1, 1), 0, tolerance) << Law::name;
    const M3 plane = stress(0, (1 + poisson) / (1 - poisson) * strain);
    EXPECT_NEAR(plane(0, 0), -young / (1 - poisson) * strain, tolerance) << Law::name;
    EXPECT_NEAR(plane(2, 2), 0, tolerance) << Law::name;
  });
}

TEST(Expansion, StressIsTheDerivativeOfTheStoredEnergy) {
  expect_gradient_of_energy(expanding<NeoHookean<double>>(warm("neo-hookean", {{0, 700}})));
  expect_gradient_of_energy(expanding<J2<double>>(metal({{0, 0}, {2e-3, -900}})));
  expect_gradient_of_energy(expanding<Maxwell<double>>(warm("maxwell", {{0, 700}})));
}

/// Stored energy, plastic and viscous work, less what changes of the temperature have done, are the
/// work of the stress, along a loop of deformation and temperature; second order but where steps
/// cross the yield surface.
TEST(Expansion, WorkIsBalanced) {
  const auto imbalance = [&](const auto& law, int steps) {
    typename std::decay_t<decltype(law)>::State state;
    M3 last_f = M3::Identity(), last_p = stress_at(law, last_f, state, 0);
    double work = 0, most = 0;
    for (int k = 1; k <= steps; ++k) {
      const double t = 2 * M_PI * k / steps;
      M3 f = M3::Identity();
      f(0, 0) += 0.1 * std::sin(t), f(0, 1) += 0.2 * (1 - std::cos(t));
      const M3 p = stress_at(law, f, state, 1.0 / steps);
      work += 0.5 * (p + last_p).cwiseProduct(f - last_f).sum();
      last_f = f, last_p = p;
      const double has = law.energy(grad_u(f), state) + heat_of<double>(law, state);
      most = std::max(most, std::abs(has));
    }
    const double has = law.energy(grad_u(last_f), state) + heat_of<double>(law, state);
    EXPECT_GT(std::abs(law.thermal_work(state)), 0.02 * most);
    return std::abs(has - law.thermal_work(state) - work) / most;
  };
  // The last temperature is not the first: heat does work around the loop, too.
  const std::vector<std::array<double, 2>> curve{{0, 0}, {0.3, 600}, {0.5, -200}, {1, 400}};
  const auto elastic = expanding<NeoHookean<double>>(warm("neo-hookean", curve));
  EXPECT_LE(imbalance(elastic, 1000), 1e-5);
  EXPECT_LE(imbalance(elastic, 10000), 1e-7);
  const auto plastic = expanding<J2<double>>(metal(curve));
  EXPECT_LE(imbalance(plastic, 2000), 2e-3);
  EXPECT_LE(imbalance(plastic, 20000), 2e-4);
}

/// After a search for rest the temperature is the last one.
TEST(Expansion, RestHasTheLastTemperature) {
  const auto law = expanding<NeoHookean<double>>(warm("neo-hookean", {{0, 0}, {1, 30}, {2, 70}}));
  ExpandingLaw<NeoHookean<double>, double>::State state;
  law.first_piola_stress(Mat3d{}, state, endless_time);
  EXPECT_EQ(state.heat.thermal_strain, 70 * expansion);
  EXPECT_EQ(state.heat.time, 2);
}

TEST(Expansion, RefusesWhatCannotBeAndSaysWhy) {
  EXPECT_EQ(law_refusal(warm("hencky", {{0, 10}, {1, 20}})), "");
  EXPECT_THAT(law_refusal(warm("hencky", {{0, 10}, {1, 1001}})),
              HasSubstr("expansion = 0.0001 1/K with a change of the temperature by 1001 K found, "
                        "a strain of 0.1001; allowed: strains from -0.1 to 0.1"));
  EXPECT_THAT(law_refusal(warm("hencky", {{0, 10}, {1, 20}, {1, 30}})),
              HasSubstr("temperature_curve: point 3 is [1, 30]; allowed: times that ascend"));
  EXPECT_THAT(law_refusal(warm("hencky", {{-1, 10}})), HasSubstr("point 1 is [-1, 10]"));
  std::vector<std::array<double, 2>> long_curve;
  for (int k = 0; k < 9; ++k) long_curve.push_back({1.0 * k, 1});
  EXPECT_THAT(law_refusal(warm("hencky", long_curve)),
              HasSubstr("temperature_curve: 9 points found; allowed: 1 to 8"));
}

}  // namespace
}  // namespace phyxel
