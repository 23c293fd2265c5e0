/// A closed surface of triangles as an obstacle.
#pragma once

#include <array>

#include "phyxel/physics/obstacle.hpp"

namespace phyxel {

/// The inside of a closed surface from a file.
struct MeshObstacle {
  static constexpr const char* name = "mesh";
  static constexpr const char* meaning = "the inside of the closed surface of `mesh`";
  static constexpr std::array<ObstacleLength, 0> lengths{};

  DistanceField field;

  /// The distance of a point in the shape's own coordinates from its surface.
  PHYXEL_HD Gap gap(Vec3<double> x) const { return field.gap(x); }
};

}  // namespace phyxel
