/// Boxes that overlap.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

#include "model/box.hpp"

namespace phyxel {

/// True if two boxes have a point in common.
PHYXEL_HD bool overlap(const Box& a, const Box& b) {
  return a.low.x <= b.high.x && b.low.x <= a.high.x && a.low.y <= b.high.y && b.low.y <= a.high.y &&
         a.low.z <= b.high.z && b.low.z <= a.high.z;
}

/// True if a point is in a box.
PHYXEL_HD bool contains(const Box& box, Vec3d x) { return overlap(box, {x, x}); }

/// The box with a margin added on all sides [m].
PHYXEL_HD Box grown(const Box& box, double margin) {
  const Vec3d by{margin, margin, margin};
  return {box.low - by, box.high + by};
}

/// Calls visit(a, b) for every two boxes that overlap, in an order of its own. Boxes that lie one
/// after the other along x cost nothing.
template <class Visit>
void for_each_overlap(std::span<const Box> boxes, Visit&& visit) {
  std::vector<std::size_t> order(boxes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return boxes[a].low.x < boxes[b].low.x; });
  std::vector<Box> sorted;  // one after the other in memory
  sorted.reserve(order.size());
  for (const std::size_t b : order) sorted.push_back(boxes[b]);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const Box box = sorted[k];
    for (std::size_t l = k + 1; l < order.size() && sorted[l].low.x <= box.high.x; ++l) {
      if (overlap(box, sorted[l])) visit(order[k], order[l]);
    }
  }
}

}  // namespace phyxel
