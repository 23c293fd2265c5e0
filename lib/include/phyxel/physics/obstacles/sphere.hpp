/// A ball as an obstacle.
#pragma once

#include "phyxel/physics/obstacle.hpp"

namespace phyxel {

/// A ball about the origin.
struct SphereObstacle {
  static constexpr const char* name = "sphere";
  static constexpr const char* meaning = "a ball about the origin";
  static constexpr ObstacleLength lengths[] = {obstacle_radius};

  double radius;

  /// The distance of a point in the shape's own coordinates from its surface.
  PHYXEL_HD Gap gap(Vec3<double> x) const { return gap_of_sphere(x, radius); }
};

}  // namespace phyxel
