/// A cylinder as an obstacle.
#pragma once

#include <cmath>

#include "phyxel/physics/obstacle.hpp"

namespace phyxel {

/// A cylinder about the origin, along z.
struct CylinderObstacle {
  static constexpr const char* name = "cylinder";
  static constexpr const char* meaning = "a cylinder about the origin, along z";
  static constexpr ObstacleLength lengths[] = {obstacle_radius, obstacle_length};

  double radius, length;

  /// The distance of a point in the shape's own coordinates from its surface.
  PHYXEL_HD Gap gap(Vec3<double> x) const {
    const Gap side = gap_of_sphere({x.x, x.y, 0}, radius);
    const double beyond[] = {side.distance, std::fabs(x.z) - 0.5 * length};
    // On the axis no direction of the side is nearest: x is.
    const Vec3<double> out = x.x == 0 && x.y == 0 ? Vec3<double>{1, 0, 0} : side.normal;
    const Vec3<double> direction[] = {out, {0, 0, x.z < 0 ? -1.0 : 1.0}};
    return gap_of_faces(beyond, direction);
  }
};

}  // namespace phyxel
