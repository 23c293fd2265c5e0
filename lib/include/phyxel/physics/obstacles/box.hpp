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
  /// What it holds (`SolidMoments`).
  SolidMoments solid() const {
    return SolidMoments::about_origin(
        size_x * size_y * size_z,
        {size_x * size_x / 12, size_y * size_y / 12, size_z * size_z / 12});
  }
  /// Calls each(x, radius) for the balls by which it touches other rigid bodies: they reach its
  /// surface where it sticks out.
  template <class Each>
  void for_each_tip(Each&& each) const {
    constexpr int parts = 4;  // of an edge
    for (int i = 0; i <= parts; ++i) {
      for (int j = 0; j <= parts; ++j) {
        for (int k = 0; k <= parts; ++k) {
          const int inner = (i % parts != 0) + (j % parts != 0) + (k % parts != 0);
          const int middle = (2 * i == parts) + (2 * j == parts) + (2 * k == parts);
          // Corners, edges, and the middle of each face.
          if (inner == 3 || (inner == 2 && middle != 2)) continue;
          const auto at = [](int n, double size) { return (n / double{parts} - 0.5) * size; };
          each(Vec3d{at(i, size_x), at(j, size_y), at(k, size_z)}, 0.0);
        }
      }
    }
  }
};

}  // namespace phyxel
