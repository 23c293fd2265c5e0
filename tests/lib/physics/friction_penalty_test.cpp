/// The potential of friction in searches by Newton's method, against its differences.
#include "phyxel/physics/friction_penalty.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace phyxel {
namespace {

const Vec3d normal = normalised(Vec3d{1, -2, 3});
const FrictionLimit limit{.force = 3, .stiffness = 2000};  // ε = 3 mm

/// Slips across the normal, in two directions, from none to much more than ε.
std::vector<Vec3d> slips() {
  const Vec3d a = normalised(cross(normal, Vec3d{1, 0, 0})), b = cross(normal, a);
  return {1e-7 * a, 1e-3 * a + 5e-4 * b, 2.9e-3 * b, -3.1e-3 * a, 0.1 * a - 0.3 * b};
}

/// The direction that belongs to a slip: f₁ s/|s|.
Vec3d direction(Vec3d slip) { return slip / slip_scale(norm(slip), limit.width()).length; }

TEST(FrictionPenalty, IsTheDerivativeOfItsPotential) {
  for (const Vec3d slip : slips()) {
    const PenaltyForce here = friction_penalty(limit, normal, slip, direction(slip));
    EXPECT_GT(here.energy, 0);
    EXPECT_LT(std::abs(dot(here.force, normal)), 1e-12);
    const double step = 1e-5 * norm(slip);
    for (const Vec3d axis : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
      const Vec3d way = step * along(normal, axis);
      const PenaltyForce before = friction_penalty(limit, normal, slip - way, {}),
                         after = friction_penalty(limit, normal, slip + way, {});
      // Central differences: off by the square of the step, and by rounding over it.
      EXPECT_NEAR(-dot(here.force, way), 0.5 * (after.energy - before.energy),
                  1e-9 * norm(here.force) * norm(way) + 1e-15 * here.energy);
      EXPECT_LE(norm(here.stiffness * way + 0.5 * (after.force - before.force)),
                1e-9 * limit.stiffness * norm(way));
    }
  }
}

TEST(FrictionPenalty, GrowsAsASpringUpToItsLimit) {
  const Vec3d way = normalised(cross(normal, Vec3d{0, 1, 0}));
  // f₁ = 2 y/ε - (y/ε)² at y = ε/2, and 1 from ε on.
  EXPECT_NEAR(norm(friction_penalty(limit, normal, 1.5e-3 * way, {}).force), 0.75 * 3, 1e-12);
  EXPECT_NEAR(norm(friction_penalty(limit, normal, 3e-3 * way, {}).force), 3, 1e-12);
  EXPECT_NEAR(norm(friction_penalty(limit, normal, 1.0 * way, {}).force), 3, 1e-12);
  const Mat3d start = friction_penalty(limit, normal, {}, {}).stiffness;
  EXPECT_NEAR(dot(way, start * way), limit.stiffness, 1e-9);
  EXPECT_NEAR(norm(start * normal), 0, 1e-9);
  // Where nothing presses there is no friction, whatever the slip.
  const PenaltyForce none = friction_penalty({.stiffness = 2000}, normal, way, {});
  EXPECT_EQ(none.force, Vec3d{});
  EXPECT_EQ(none.energy, 0);
}

TEST(FrictionPenalty, IsNowhereOfNegativeStiffnessForAnyDirectionThatASearchHas) {
  const Vec3d a = normalised(cross(normal, Vec3d{1, 0, 0})), b = cross(normal, a);
  for (const Vec3d slip : slips()) {
    for (const Vec3d way : {Vec3d{}, a, -b, 0.6 * a - 0.8 * b, 0.3 * b}) {
      const PenaltyForce of_way = friction_penalty(limit, normal, slip, way);
      EXPECT_EQ(of_way.force, friction_penalty(limit, normal, slip, direction(slip)).force);
      const double aa = dot(a, of_way.stiffness * a), bb = dot(b, of_way.stiffness * b),
                   ab = dot(a, of_way.stiffness * b);
      const double rounding = 1e-12 * (aa + bb);
      EXPECT_GE(aa, -rounding);
      EXPECT_GE(bb, -rounding);
      EXPECT_GE(aa * bb - ab * ab, -rounding * (aa + bb));
    }
  }
}

TEST(FrictionPenalty, FindsWhereAPullEndsThoughItsWidthIsAMillionthOfTheWay) {
  // A spring of 1 N/mm pulls a point from 1 m away against 3 N: it ends 3 mm before its place.
  const double spring = 1000;
  const Vec3d across = normalised(cross(normal, Vec3d{0, 1, 0}));
  for (const double width : {1e-3, 1e-6, 1e-9}) {
    const FrictionLimit thin{.force = 3, .stiffness = 6 / width};
    Vec3d slip = 1e-3 * cross(normal, across), way;
    int steps = 0;
    for (; steps < 60; ++steps) {
      const PenaltyForce friction = friction_penalty(thin, normal, slip, way);
      const Vec3d force = friction.force + spring * (across - slip);
      if (norm(force) < 1e-9 * spring) break;
      const Mat3d stiffness = friction.stiffness + spring * identity<double>();
      const Vec3d next =
          slip + (1 / determinant(stiffness)) * (transpose(cofactor(stiffness)) * force);
      way = next_way(slip, way, thin.width(), next);
      slip = next;
    }
    EXPECT_LE(steps, 20);
    EXPECT_NEAR(dot(slip, across), 1 - 0.003, 1e-8);
  }
}

/// A point above four phyxels of a surface that do not lie on a regular lattice.
struct Above {
  SurfaceTouch touch{.is_inside = true, .normal = normal};
  std::vector<Vec3d> place;
  std::vector<SurfaceShare> shares;
  Vec3d point;

  Above() {
    const Vec3d a = normalised(cross(normal, Vec3d{1, 0, 0})), b = cross(normal, a);
    place = {0.1 * a, 0.12 * b, -0.09 * a + 0.01 * normal, -0.1 * b + 0.03 * a};
    const double weights[] = {0.1, 0.4, 0.3, 0.2};
    point = 0.02 * a - 0.03 * b + 0.05 * normal;
    for (int k = 0; k < 4; ++k) touch.centre += weights[k] * place[k];
    Sym3<double> spread{};
    for (int k = 0; k < 4; ++k) {
      const Vec3d z = along(normal, place[k] - touch.centre);
      spread.xx += weights[k] * z.x * z.x;
      spread.xy += weights[k] * z.x * z.y;
      spread.xz += weights[k] * z.x * z.z;
      spread.yy += weights[k] * z.y * z.y;
      spread.yz += weights[k] * z.y * z.z;
      spread.zz += weights[k] * z.z * z.z;
    }
    touch.inverse_spread = inverse_along(normal, spread);
    const Vec3d tilt = touch.inverse_spread * along(normal, point - touch.centre);
    Vec3d reached;
    for (int k = 0; k < 4; ++k) {
      shares.push_back({weights[k], weights[k] * (1 + dot(tilt, place[k] - touch.centre)), 0});
      reached += shares[k].part * place[k];
    }
    touch.height = dot(normal, point - reached);
  }
  Vec3d slip(Vec3d of_point, const std::vector<Vec3d>& moved) const {
    Vec3d all = along(normal, of_point);
    for (int k = 0; k < 4; ++k) all += slip_share(touch, shares[k], place[k]) * moved[k];
    return all;
  }
};

TEST(SlipOfSurfaces, IsWhatFrictionDoesWorkOn) {
  const Above above;
  SurfaceForce force;
  force.set_friction(above.touch, along(normal, Vec3d{2, 1, -1}));
  const Vec3d of_point{0.3, -0.1, 0.2};
  const std::vector<Vec3d> moved{{0.1, 0, 0.2}, {-0.2, 0.1, 0.3}, {0, 0.4, -0.1}, {0.2, -0.3, 0}};
  double work = dot(force.tangential, of_point);
  Vec3d sum = force.tangential, moment = cross(above.point, force.tangential);
  for (int k = 0; k < 4; ++k) {
    const Vec3d back = force.tangential_reaction(above.touch, above.shares[k], above.place[k]);
    work += dot(back, moved[k]);
    sum += back;
    moment += cross(above.place[k], back);
  }
  EXPECT_NEAR(work, dot(force.tangential, above.slip(of_point, moved)), 1e-15);
  EXPECT_LE(norm(sum), 1e-14);
  EXPECT_LE(norm(moment), 1e-15);
}

TEST(SlipOfSurfaces, IsNoneInARigidMotion) {
  const Above above;
  EXPECT_GT(above.touch.height, 0.04);
  const Vec3d shift{1, 2, 3}, turn{0.3, -0.2, 0.5};
  std::vector<Vec3d> moved;
  for (const Vec3d y : above.place) moved.push_back(shift + cross(turn, y));
  EXPECT_LE(norm(above.slip(shift + cross(turn, above.point), moved)), 1e-14);
}

}  // namespace
}  // namespace phyxel
