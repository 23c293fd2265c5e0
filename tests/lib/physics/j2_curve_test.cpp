/// J2 plasticity whose flow stress is a table, at a point.
#include "phyxel/physics/laws/j2_curve.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <string>

#include "support/j2.hpp"
#include "support/plastic_points.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;
using Curve = ParameterValue::Curve;
using Law = J2Curve<double>;

/// Copper in GPa, of a curve that rises, rests, falls and rises again.
const Curve mixed = {{0, 0.4}, {0.01, 0.5}, {0.05, 0.5}, {0.1, 0.45}, {0.4, 0.7}, {1.5, 0.9}};

Material copper(const Curve& curve) {
  Material m;
  m.young = 117, m.poisson = 0.35;
  m.law = "j2-curve";
  m.parameters = {{"flow_curve", curve}};
  return m;
}

/// The curve at a plastic strain, as its definition says.
double at(const Curve& curve, double strain) {
  for (std::size_t k = 1; k < curve.size(); ++k) {
    const auto [x, y] = curve[k - 1];
    if (strain < curve[k][0]) return y + (curve[k][1] - y) * (strain - x) / (curve[k][0] - x);
  }
  return curve.back()[1];
}
/// Its integral, by trapezia that end at its points.
double area(const Curve& curve, double strain) {
  double sum = 0, last = 0;
  for (const auto& point : curve) {
    const double x = std::min(point[0], strain);
    sum += 0.5 * (at(curve, last) + at(curve, x)) * (x - last), last = x;
  }
  return sum + curve.back()[1] * (strain - last);
}

TEST(J2Curve, UniaxialCyclesAreTheClosedForm) {
  for (const Curve& curve : {mixed, Curve{{0, 0.4}}, Curve{{0, 0.4}, {0.2, 0.6}}}) {
    const Material m = copper(curve);
    const Law law = law_of<Law>(m);
    expect_uniaxial_cycles(
        law, m.young, m.poisson, 1e-3, [&](double e, double, double) { return at(curve, e); },
        [&](const Law::State& s, double e, double) {
          // Rounding of 700 steps.
          EXPECT_NEAR(law.plastic_work(s), area(curve, e), 1e-12);
        });
  }
}

TEST(J2Curve, TwoPointsAreLinearHardening) {
  Deformations any(1);
  const Law law = law_of<Law>(copper({{0, 0.4}, {100, 10.4}}));
  const J2<double> linear = law_of<J2<double>>(j2::linear);
  Law::State one;
  J2<double>::State other;
  for (int k = 0; k < 300; ++k) {
    const Mat3d g = grad_u(any.gradient(0.7, 1.4));
    // Slopes are quotients of the same numbers: rounding over 300 steps of strain 1, times E.
    EXPECT_LE(distance(eigen(law.first_piola_stress(g, one, 1)),
                       eigen(linear.first_piola_stress(g, other, 1))),
              1e-9);
  }
  EXPECT_NEAR(one.equivalent_plastic_strain / other.equivalent_plastic_strain, 1, 1e-11);
}

/// However large the step, over whatever points of the curve, falling ones included.
TEST(J2Curve, EndsOnTheCurveAfterStepsOfAnySize) {
  expect_yield_surface(law_of<Law>(copper(mixed)), 1e-3, [](const auto& s, double, double) {
    return at(mixed, s.equivalent_plastic_strain);
  });
}

TEST(J2Curve, TurningBodiesChangesNothing) {
  expect_rotation_invariance(law_of<Law>(copper(mixed)), 117, 1e-3);
}

TEST(J2Curve, WorkIsStoredOrDissipated) { expect_balance_of_work(law_of<Law>(copper(mixed)), 1); }

TEST(J2Curve, StressIsTheDerivativeOfTheStoredEnergyAtAFrozenHistory) {
  expect_gradient_of_energy(law_of<Law>(copper(mixed)));
}

TEST(J2Curve, LanesOfAPackHaveTheBitsOfScalars) {
  expect_lanes_to_have_the_bits_of_scalars<J2Curve, float, 16>(copper(mixed), 0.01);
  expect_lanes_to_have_the_bits_of_scalars<J2Curve, double, 8>(copper(mixed), 0.01);
}

TEST(J2Curve, WaveStiffnessIsBounded) {
  Law strong = law_of<Law>(copper(mixed));
  strong.yield_stress = 1e6;
  expect_wave_bound(law_of<Law>(copper(mixed)), strong);
}

TEST(J2Curve, RefusesWhatCannotBeAndSaysWhy) {
  EXPECT_EQ(law_refusal(copper(mixed)), "");
  const auto expect = [](const Curve& curve, const char* found, const char* allowed) {
    const std::string text = law_refusal(copper(curve));
    EXPECT_THAT(text, HasSubstr("flow_curve")) << text;
    EXPECT_THAT(text, HasSubstr(found)) << text;
    EXPECT_THAT(text, HasSubstr(allowed)) << text;
  };
  expect({}, "0 points found", "1 to 16 points");
  expect(Curve(17, {0, 1}), "17 points found", "1 to 16 points");
  expect({{0.1, 1}}, "point 1 is [0.1, 1]", "x (plastic strain) ascends from 0");
  expect({{0, 1}, {0.2, 1}, {0.2, 2}}, "point 3 is [0.2, 2]", "ascends from 0");
  expect({{0, 1}, {0.2, 0}}, "point 2 is [0.2, 0]", "1e-12 <= y <= 1e+18 [Pa]");
  expect({{0, 1}, {0.2, -3}}, "point 2 is [0.2, -3]", "1e-12 <= y");
  expect({{0, std::nan("")}}, "point 1 is [0, nan]", "1e-12 <= y");
  expect({{0, 1}, {HUGE_VAL, 2}}, "point 2 is [inf, 2]", "ascends from 0");
  expect({{0, 10}, {0.1, 1}}, "[[0, 10], [0.1, 1]]", "nowhere falls by the shear modulus");
  Material m = copper(mixed);
  m.parameters["flow_curve"] = 3.0;
  EXPECT_THAT(law_refusal(m), HasSubstr("flow_curve = 3 found; allowed: [[x, y], ...]"));
  m.parameters.clear();
  EXPECT_THAT(law_refusal(m), HasSubstr("flow_curve is missing"));
}

}  // namespace
}  // namespace phyxel
