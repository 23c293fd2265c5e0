#include "model/space_filling_curve.hpp"

namespace phyxel {

std::vector<Index> curve_order(std::span<const Vec3d> position) {
  if (position.empty()) return {};
  Vec3d low = position.front(), high = low;
  for (const Vec3d& x : position) {
    low = {std::min(low.x, x.x), std::min(low.y, x.y), std::min(low.z, x.z)};
    high = {std::max(high.x, x.x), std::max(high.y, x.y), std::max(high.z, x.z)};
  }
  const HilbertFrame frame = HilbertFrame::around(low, high);
  const auto n = static_cast<Index>(position.size());
  std::vector<std::pair<std::uint64_t, Index>> keys(position.size());
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < n; ++i) keys[i] = {frame.key_of(position[i]), i};
  std::sort(keys.begin(), keys.end());
  std::vector<Index> order;
  order.reserve(keys.size());
  for (const auto& key : keys) order.push_back(key.second);
  return order;
}

}  // namespace phyxel
