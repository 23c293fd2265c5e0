/// The phyxel to which a surfel belongs.
#pragma once

#include <algorithm>

#include "phyxel/model.hpp"

namespace phyxel {

/// True if phyxel a is nearer at rest to a point than phyxel b; of two equally near ones the phyxel
/// with the smaller global id is, so that the order does not depend on ranks.
inline bool is_nearer(const Model& model, Vec3d point, Index a, Index b) {
  const Vec3d x = model.position[a] - point, y = model.position[b] - point;
  const double to_a = dot(x, x), to_b = dot(y, y);
  return to_a != to_b ? to_a < to_b : model.global_id(a) < model.global_id(b);
}

/// The carrier of a surfel that is nearest at rest, to whose side of a crack the surfel belongs; -1
/// for a surfel without carriers.
inline Index nearest_carrier(const Model& model, Index surfel) {
  const auto row = model.surfels.carriers.row(surfel);
  const Vec3d point = model.surfels.position[surfel];
  const auto nearest = std::min_element(
      row.begin(), row.end(), [&](Index a, Index b) { return is_nearer(model, point, a, b); });
  return nearest == row.end() ? -1 : *nearest;
}

}  // namespace phyxel
