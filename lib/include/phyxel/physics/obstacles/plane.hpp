/// A half-space as an obstacle.
#pragma once

#include <array>

#include "phyxel/physics/obstacle.hpp"

namespace phyxel {

/// The half-space z < 0, whose surface faces z.
struct PlaneObstacle {
  static constexpr const char* name = "plane";
  static constexpr const char* meaning = "all that lies below z = 0";
  static constexpr std::array<ObstacleLength, 0> lengths{};

  /// The distance of a point in the shape's own coordinates from its surface.
  PHYXEL_HD Gap gap(Vec3<double> x) const { return {x.z, {0, 0, 1}}; }
};

}  // namespace phyxel
