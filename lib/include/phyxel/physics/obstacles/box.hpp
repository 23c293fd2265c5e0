/// A box as an obstacle.
#pragma once

#include <cmath>

#include "phyxel/physics/obstacle.hpp"

namespace phyxel {

/// A box about the origin, with edges along the axes.
struct BoxObstacle {
  static constexpr const char* name = "box";
  static constexpr const char* meaning = "a box about the origin";
  static constexpr ObstacleLength lengths[] = {obstacle_size[0], obstacle_size[1],
                                               obstacle_size[2]};

  double size_x, size_y, size_z;

  /// The distance of a point in the shape's own coordinates from its surface.
  PHYXEL_HD Gap gap(Vec3<double> x) const {
    const double beyond[] = {std::fabs(x.x) - 0.5 * size_x, std::fabs(x.y) - 0.5 * size_y,
                             std::fabs(x.z) - 0.5 * size_z};
    const Vec3<double> direction[] = {
        {x.x < 0 ? -1.0 : 1.0, 0, 0}, {0, x.y < 0 ? -1.0 : 1.0, 0}, {0, 0, x.z < 0 ? -1.0 : 1.0}};
    return gap_of_faces(beyond, direction);
  }
};

}  // namespace phyxel
