/// Groups of phyxels of a contact layer, which are tested against obstacles by their boxes first.
#pragma once

#include <cmath>
#include <vector>

#include "model/box.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// The box of no points.
inline constexpr Box no_box{{HUGE_VAL, HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}};

/// Extends a box to a point.
inline void extend(Box& box, Vec3d x) {
  box.low = {std::min(box.low.x, x.x), std::min(box.low.y, x.y), std::min(box.low.z, x.z)};
  box.high = {std::max(box.high.x, x.x), std::max(box.high.y, x.y), std::max(box.high.z, x.z)};
}

/// The box around two boxes; the box of no points adds nothing.
inline Box together(Box a, const Box& b) {
  a.low = {std::min(a.low.x, b.low.x), std::min(a.low.y, b.low.y), std::min(a.low.z, b.low.z)};
  a.high = {std::max(a.high.x, b.high.x), std::max(a.high.y, b.high.y),
            std::max(a.high.z, b.high.z)};
  return a;
}

/// True if a box is inside another one; the box of no points is inside all.
inline bool is_within(const Box& inner, const Box& outer) {
  return inner.low.x >= outer.low.x && inner.low.y >= outer.low.y && inner.low.z >= outer.low.z &&
         inner.high.x <= outer.high.x && inner.high.y <= outer.high.y &&
         inner.high.z <= outer.high.z;
}

/// A range of entries of a contact layer: a few hundred phyxels, one after the other, of one body.
struct LayerGroup {
  std::size_t begin = 0, end = 0;
  double offset = 0;   ///< The largest distance of its phyxels from their surface [m].
  double support = 0;  ///< The largest support of its phyxels [m].
};

/// The groups of a layer, in its order.
std::vector<LayerGroup> groups_of(const Model& model, const ContactLayer& layer);

/// The box around the places of the phyxels of a group. @param displacement returns that of a
/// phyxel [m]
template <class Displacement>
Box box_of_group(const Model& model, const LayerGroup& group, Displacement&& displacement) {
  Box box = no_box;
  for (std::size_t k = group.begin; k < group.end; ++k) {
    const Index i = model.contact.phyxels[k];
    extend(box, model.position[i] + displacement(i));
  }
  return box;
}

/// True only if each point of a box is farther from an obstacle than `offset` [m], in spite of
/// rounding; false where that takes more than a look at the obstacle's bounds.
/// @param at where the obstacle is
bool is_clear_of(const Obstacle& obstacle, const ObstacleStep& at, const Box& box, double offset);

}  // namespace phyxel
