/// A capsule as an obstacle.
#pragma once

#include <numbers>

#include "phyxel/physics/obstacle.hpp"

namespace phyxel {

/// A cylinder about the origin, along z, with half a ball on each end.
struct CapsuleObstacle {
  static constexpr const char* name = "capsule";
  static constexpr const char* meaning =
      "a cylinder about the origin, along z, with half a ball on each end";
  static constexpr ObstacleLength lengths[] = {obstacle_radius, obstacle_length};

  double radius, length;

  /// The distance of a point in the shape's own coordinates from its surface.
  PHYXEL_HD Gap gap(Vec3<double> x) const {
    const double half = 0.5 * length;
    const double along = x.z < -half ? -half : x.z > half ? half : x.z;
    const Vec3<double> off = {x.x, x.y, x.z - along};
    if (off.x == 0 && off.y == 0 && off.z == 0) return {-radius, {1, 0, 0}};
    return gap_of_sphere(off, radius);
  }
  /// What it holds (`SolidMoments`).
  SolidMoments solid() const {
    const double square = radius * radius, half = 0.5 * length;
    const double middle = std::numbers::pi * square * length,
                 ends = 4.0 / 3 * std::numbers::pi * square * radius;
    const double across = middle * square / 4 + ends * square / 5;
    const double along =
        middle * length * length / 12 + ends * (half * half + 0.75 * half * radius + square / 5);
    const double volume = middle + ends;
    return SolidMoments::about_origin(volume, {across / volume, across / volume, along / volume});
  }
  /// Calls each(x, radius, core) for the balls at x by which it touches other rigid bodies: they
  /// reach its surface where it sticks out; `core` is the place nearest to x on its middle.
  template <class Each>
  void for_each_tip(Each&& each) const {
    constexpr int parts = 16;
    for (int n = 0; n <= parts; ++n) {
      const Vec3d x{0, 0, (n / double{parts} - 0.5) * length};
      each(x, radius, x);
    }
  }
};

}  // namespace phyxel
