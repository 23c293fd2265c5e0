#include "mesh/point_tree.hpp"

#include <algorithm>
#include <bit>

#include "model/space_filling_curve.hpp"

namespace phyxel {

Box box_of(const Box& a, const Box& b) {
  return {
      {std::min(a.low.x, b.low.x), std::min(a.low.y, b.low.y), std::min(a.low.z, b.low.z)},
      {std::max(a.high.x, b.high.x), std::max(a.high.y, b.high.y), std::max(a.high.z, b.high.z)}};
}

PointTree::PointTree(std::span<const Vec3d> point, std::size_t most)
    : order_(curve_order(point, 0, static_cast<Index>(point.size()))) {
  leaves_ = std::bit_ceil(std::max<std::size_t>(1, order_.size() / most));
  move_to(point);
}

void PointTree::move_to(std::span<const Vec3d> point) {
  const auto of_point = [&](std::size_t k) { return Box{point[order_[k]], point[order_[k]]}; };
  box_ = summaries(of_point, box_of);
}

}  // namespace phyxel
