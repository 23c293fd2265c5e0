#include "model/space_filling_curve.hpp"

#include "model/box.hpp"

namespace phyxel {

std::vector<Index> curve_order(std::span<const Vec3d> position, Index begin, Index end) {
  const auto count = static_cast<std::size_t>(end - begin);
  const Box box = box_around(position.subspan(static_cast<std::size_t>(begin), count));
  const HilbertFrame frame = HilbertFrame::around(box.low, box.high);
  std::vector<std::pair<std::uint64_t, Index>> keys(count);
#pragma omp parallel for schedule(static)
  for (Index i = begin; i < end; ++i) keys[i - begin] = {frame.key_of(position[i]), i};
  std::sort(keys.begin(), keys.end());
  std::vector<Index> order;
  order.reserve(keys.size());
  for (const auto& key : keys) order.push_back(key.second);
  return order;
}

}  // namespace phyxel
