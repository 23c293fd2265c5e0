/// A ball as an obstacle.
#pragma once

#include <numbers>

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
  /// What it holds (`SolidMoments`).
  SolidMoments solid() const {
    const double volume = 4.0 / 3 * std::numbers::pi * radius * radius * radius,
                 square = radius * radius / 5;
    return SolidMoments::about_origin(volume, {square, square, square});
  }
  /// Calls each(x, radius, core) for the balls at x by which it touches other rigid bodies: they
  /// reach its surface where it sticks out; `core` is the place nearest to x on its middle.
  template <class Each>
  void for_each_tip(Each&& each) const {
    each(Vec3d{}, radius, Vec3d{});
  }
};

}  // namespace phyxel
