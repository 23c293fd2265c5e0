/// Metals, wood and viscosity: problems of phyxel accuracy, at resolutions that take seconds.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "support/accuracy.hpp"

namespace phyxel {
namespace {

using app::Discretisation;
using app::Filling;
using app::Quantity;
using app::Solution;
using testing::error_of;
using testing::solved;

/// Increments of Newton's method to 10⁻¹⁰ of the reactions; seen: 2e-12 of the yield stress on 64
/// nodes. Without closed gradients the sides are not quite free of stress: 2.6e-3.
TEST(PlasticAccuracy, CyclesFollowTheRodOfOneDimension) {
  for (const auto& [filling, across] : {std::pair(Filling::nodes, 3), {Filling::mesh, 5}}) {
    const Solution s = solved(
        "cycles", {.filling = filling, .hourglass = 0.1, .closure = 1e-11, .across = across});
    EXPECT_LT(s.found.at(0).value, 1e-6) << app::filling_name(filling);
  }
}

/// A thousand steps in double round to 10⁻¹³; the issue asks for 10⁻⁸.
TEST(PlasticAccuracy, SimpleShearStaysOnTheYieldSurfaceInAnyDirection) {
  const Solution s = solved("simple-shear", {.jitter = 0.2, .across = 3});
  ASSERT_EQ(s.found.size(), 3u);
  for (const Quantity& q : s.found) EXPECT_LT(q.value, 1e-8) << q.name;
}

/// 540 phyxels; seen: 0.2%, with closed gradients 0.1%. The radius: 0.5%.
TEST(PlasticAccuracy, TubesCollapseUnderHillsPressure) {
  const Solution plain = solved("tube", {.hourglass = 0.1, .across = 8});
  EXPECT_LT(std::abs(error_of(plain, "collapse pressure")), 0.015);
  EXPECT_LT(std::abs(error_of(plain, "plastic radius")), 0.015);
  const Solution closed = solved("tube", {.hourglass = 0.1, .closure = 1e-3, .across = 8});
  EXPECT_LT(std::abs(error_of(closed, "collapse pressure")), 0.005);
}

/// 1,183 phyxels, 6 cells of the wall; seen: 0.2%, of the radius 1.2%.
TEST(PlasticAccuracy, SpheresCollapseUnderHillsPressure) {
  const Solution s = solved("sphere", {.hourglass = 0.1, .closure = 1e-3, .across = 6});
  EXPECT_LT(std::abs(error_of(s, "collapse pressure")), 0.015);
  EXPECT_LT(std::abs(error_of(s, "plastic radius")), 0.015);
}

/// 2,501 phyxels. The published spans are 0.9%, 1.9% and 14% wide to both sides of the references;
/// length within 1% and radius within 3% of them are asked for. The ledger: kinetic, elastic and
/// hourglass energy and plastic work are what the rod arrived with.
TEST(PlasticAccuracy, TaylorsBarIsAsLongAndWideAsPublished) {
  const Solution s = solved("taylor", {.hourglass = 0.1, .across = 8});
  EXPECT_LT(std::abs(error_of(s, "length in mm")), 0.009 + 0.01);
  EXPECT_LT(std::abs(error_of(s, "radius of the foot in mm")), 0.019 + 0.03);
  EXPECT_LT(std::abs(error_of(s, "largest plastic strain")), 0.14);
  EXPECT_LT(std::abs(error_of(s, "energy")), 1e-3);
}

/// Seen: 0.11% at most, along the grain; the issue asks for 0.5%.
TEST(WoodAccuracy, BarsOfWoodHaveTheModulusOfTheirAngle) {
  const Solution s = solved("wood", {.hourglass = 0.1, .across = 4});
  ASSERT_EQ(s.found.size(), 4u);
  for (const Quantity& q : s.found) EXPECT_LT(std::abs(q.error()), 0.002) << q.name;
}

/// Seen: 1.4e-4.
TEST(ViscousAccuracy, SwingsOfABarShrinkAsKelvinAndVoigtHaveIt) {
  const Solution s = solved("damping", {.hourglass = 0.1, .across = 4});
  EXPECT_LT(std::abs(error_of(s, "decrement")), 0.01);
}

}  // namespace
}  // namespace phyxel
