/// A box as an obstacle.
#pragma once

#include <algorithm>
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
  /// Calls each(x, radius, core) for the balls at x by which it touches other rigid bodies: they
  /// reach its surface where it sticks out; `core` is the place nearest to x on its middle.
  template <class Each>
  void for_each_tip(Each&& each) const {
    // Parts of edges are no longer than half of the thickness: what crosses an edge meets some.
    const double thickness = std::min({size_x, size_y, size_z}),
                 part = std::max(0.5 * thickness, std::max({size_x, size_y, size_z}) / 64);
    const auto parts_of = [&](double size) {
      return 4 * static_cast<int>(std::ceil(size / (4 * part)));
    };
    const int nx = parts_of(size_x), ny = parts_of(size_y), nz = parts_of(size_z);
    const auto at = [](int n, int parts, double size) { return (n / double(parts) - 0.5) * size; };
    const auto core = [&](double value, double size) {
      const double most = 0.5 * (size - thickness);
      return std::clamp(value, -most, most);
    };
    for (int i = 0; i <= nx; ++i) {
      for (int j = 0; j <= ny; ++j) {
        for (int k = 0; k <= nz; ++k) {
          const int inner = (i % nx != 0) + (j % ny != 0) + (k % nz != 0);
          const int middle = (2 * i == nx) + (2 * j == ny) + (2 * k == nz);
          // Corners, edges, and the middle of each face.
          if (inner == 3 || (inner == 2 && middle != 2)) continue;
          const Vec3d x{at(i, nx, size_x), at(j, ny, size_y), at(k, nz, size_z)};
          each(x, 0.0, Vec3d{core(x.x, size_x), core(x.y, size_y), core(x.z, size_z)});
        }
      }
    }
  }
};

}  // namespace phyxel
