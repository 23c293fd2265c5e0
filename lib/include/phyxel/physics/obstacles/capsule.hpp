/// A capsule as an obstacle.
#pragma once

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
};

}  // namespace phyxel
