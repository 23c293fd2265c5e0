/// Checks that every closed surface of one part must pass.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "phyxel/mesh.hpp"

namespace phyxel::testing {

/// V - E + F of a closed triangulated surface, where E = 3/2 F.
inline Offset euler_characteristic(const Surface& surface) {
  return static_cast<Offset>(surface.position.size()) -
         static_cast<Offset>(surface.triangle.size()) / 2;
}

/// The smallest ratio, over all triangles, of twice the area to the square of the longest side.
inline double worst_triangle(const Surface& surface) {
  double worst = 1;
  for (const Triangle& t : surface.triangle) {
    const Vec3d a = surface.position[t[0]], b = surface.position[t[1]], c = surface.position[t[2]];
    const double longest = std::max(norm(b - a), std::max(norm(c - b), norm(a - c)));
    worst = std::min(worst, norm(cross(b - a, c - a)) / (longest * longest));
  }
  return worst;
}

/// Expects a closed manifold surface of one part, oriented outwards, without handles and with unit
/// normals.
inline void expect_closed_ball(const Surface& surface) {
  const SurfaceDefects defects = inspect_surface(surface);
  EXPECT_TRUE(defects.clean()) << defects.describe();
  EXPECT_EQ(defects.parts, 1);
  EXPECT_EQ(euler_characteristic(surface), 2);
  EXPECT_GT(enclosed_volume(surface), 0);
  ASSERT_EQ(surface.normal.size(), surface.position.size());
  for (const Vec3d& n : surface.normal) EXPECT_NEAR(norm(n), 1, 1e-12);
}

}  // namespace phyxel::testing
