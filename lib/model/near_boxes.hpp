/// Boxes that overlap, among boxes that move.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "model/box_overlaps.hpp"
#include "model/contact_groups.hpp"

namespace phyxel {

/// Finds the overlaps of the same boxes again and again. It keeps a list of the pairs whose boxes
/// overlap with a margin, and tests only these pairs until a box leaves its place in that list. The
/// overlaps that it finds do not depend on earlier calls.
class NearBoxes {
 public:
  /// Calls visit(a, b) for every two boxes that overlap, in an order of its own.
  template <class Visit>
  void for_each_overlap(std::span<const Box> boxes, Visit&& visit) {
    if (!has_listed(boxes)) list(boxes);
    for (const auto& [a, b] : pairs_) {
      if (overlap(boxes[a], boxes[b])) visit(a, b);
    }
  }

 private:
  /// True if the list has all overlaps of these boxes.
  bool has_listed(std::span<const Box> boxes) const;
  void list(std::span<const Box> boxes);

  std::vector<Box> listed_;  // the boxes with their margin
  std::vector<std::pair<std::size_t, std::size_t>> pairs_;
};

}  // namespace phyxel
