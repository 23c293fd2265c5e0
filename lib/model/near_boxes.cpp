#include "model/near_boxes.hpp"

#include <cmath>

namespace phyxel {
namespace {

/// The margin of listed boxes [m]: bodies of a heap cross it in some ten looks at contact, and have
/// about three times as many pairs with it.
double margin_of(std::span<const Box> boxes) {
  constexpr double share_of_extent = 0.2;
  double sum = 0, count = 0;
  for (const Box& box : boxes) {
    if (!(box.low.x <= box.high.x)) continue;  // of no points
    sum += box.extent();
    ++count;
  }
  const double margin = share_of_extent * sum / count;
  return std::isfinite(margin) ? margin : 0;
}

}  // namespace

bool NearBoxes::has_listed(std::span<const Box> boxes) const {
  if (boxes.size() != listed_.size()) return false;
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    if (!is_within(boxes[b], listed_[b])) return false;
  }
  return true;
}

void NearBoxes::list(std::span<const Box> boxes) {
  const double margin = margin_of(boxes);
  listed_.clear();
  for (const Box& box : boxes) listed_.push_back(grown(box, margin));
  pairs_.clear();
  phyxel::for_each_overlap(std::span<const Box>(listed_),
                           [&](std::size_t a, std::size_t b) { pairs_.emplace_back(a, b); });
}

}  // namespace phyxel
