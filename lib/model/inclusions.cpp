#include "model/inclusions.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "model/box.hpp"
#include "model/selection.hpp"
#include "phyxel/error.hpp"

namespace phyxel {

SortedCloud sort_by_material(const BodyRequest& request, const Cloud& cloud) {
  const std::size_t n = cloud.position.size();
  std::vector<std::size_t> group_of(n, 0);
  for (std::size_t k = 0; k < request.inclusions.size(); ++k) {
    const Selection& selection = request.inclusions[k].select;
    const std::vector<Index> chosen =
        select(selection, {cloud, {}, static_cast<Index>(n)}, request.name);
    if (chosen.empty()) refuse_selection(selection, request.name, box_around(cloud.position));
    for (const Index i : chosen) group_of[i] = k + 1;
  }
  std::vector<Index> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = static_cast<Index>(i);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return group_of[a] < group_of[b]; });
  SortedCloud sorted{cloud, std::vector<Index>(n), {}};
  reorder(sorted.cloud, order);
  Index end = 0;
  for (std::size_t k = 0; k <= request.inclusions.size(); ++k) {
    const Index begin = end;
    while (end < static_cast<Index>(n) && group_of[order[end]] == k) ++end;
    if (begin == end && k == 0) {
      throw InputError(fmt::format(
          "{}: body \"{}\": no phyxel is left of its own material; allowed are inclusions that "
          "leave some, or that material as the body's",
          request.inclusions[0].select.where, request.name));
    }
    if (begin == end) continue;
    sorted.groups.push_back(
        {k == 0 ? request.material : request.inclusions[k - 1].material,
         k == 0 ? request.name : fmt::format("{}, inclusion {}", request.name, k), begin, end});
  }
  for (std::size_t k = 0; k < n; ++k) sorted.place[order[k]] = static_cast<Index>(k);
  return sorted;
}

}  // namespace phyxel
