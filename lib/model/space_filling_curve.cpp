#include "model/space_filling_curve.hpp"

#include "model/box.hpp"
#include "parallel_sort.hpp"
#include "tabulated.hpp"

namespace phyxel {

std::vector<Index> curve_order(std::span<const Vec3d> position, Index begin, Index end) {
  const auto count = static_cast<std::size_t>(end - begin);
  const Box box = box_around(position.subspan(static_cast<std::size_t>(begin), count));
  const HilbertFrame frame = HilbertFrame::around(box.low, box.high);
  auto keys = in_bulk(count, [&](std::size_t k) {
    const Index i = begin + static_cast<Index>(k);
    return std::pair{frame.key_of(position[i]), i};
  });
  parallel_sort(keys);
  return tabulated(count, [&](std::size_t k) { return keys[k].second; });
}

}  // namespace phyxel
