/// A cylinder as an obstacle.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

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
  /// What it holds (`SolidMoments`).
  SolidMoments solid() const {
    const double across = radius * radius / 4;
    return SolidMoments::about_origin(std::numbers::pi * radius * radius * length,
                                      {across, across, length * length / 12});
  }
  /// Calls each(x, radius, core) for the balls at x by which it touches other rigid bodies: they
  /// reach its surface where it sticks out; `core` is the place nearest to x on its middle.
  template <class Each>
  void for_each_tip(Each&& each) const {
    constexpr int around = 96, parts = 4;  // rolls as smoothly as a polygon of so many sides
    constexpr int fewer = 4;  // on rings between, by which sticks that cross it meet it
    const int rings =
        parts * static_cast<int>(std::ceil(std::clamp(length / radius / 2, 1.0, 16.0)));
    const double depth = std::min(radius, 0.5 * length);
    const auto add = [&](Vec3d x, double r) {
      const double most = 0.5 * length - depth, part = std::min(r, radius - depth) / r;
      each(x, 0.0, Vec3d{part * x.x, part * x.y, std::clamp(x.z, -most, most)});
    };
    for (int k = 0; k < around; ++k) {
      const double angle = 2 * std::numbers::pi * k / around;
      const Vec3d out{std::cos(angle), std::sin(angle), 0};
      const auto at = [&](double r, int n) {
        return Vec3d{r * out.x, r * out.y, (n / double(rings) - 0.5) * length};
      };
      for (int n = 0; n <= rings; ++n) {
        if (n % (rings / parts) == 0 || k % fewer == 0) add(at(radius, n), radius);
      }
      if (k % 12 != 0) continue;  // the ends
      for (int n = 0; n <= rings; n += rings) add(at(radius / 2, n), radius / 2);
    }
  }
};

}  // namespace phyxel
