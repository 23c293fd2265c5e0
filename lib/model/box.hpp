/// The box around points.
#pragma once

#include <algorithm>
#include <span>

#include "phyxel/types.hpp"

namespace phyxel {

struct Box {
  Vec3d low, high;  ///< [m]
  double extent() const { return std::max({high.x - low.x, high.y - low.y, high.z - low.z}); }
  /// The largest coordinate, unsigned [m].
  double farthest() const { return std::max({-low.x, high.x, -low.y, high.y, -low.z, high.z}); }
};

/// Of no points: at the origin.
inline Box box_around(std::span<const Vec3d> points) {
  if (points.empty()) return {};
  Box box{points.front(), points.front()};
  for (const Vec3d& p : points) {
    box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y), std::min(box.low.z, p.z)};
    box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y), std::max(box.high.z, p.z)};
  }
  return box;
}

}  // namespace phyxel
