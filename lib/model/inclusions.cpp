#include "model/inclusions.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "model/box.hpp"
#include "phyxel/error.hpp"

namespace phyxel {

MaterialChoice choose_materials(const BodyRequest& request, const SomePhyxels& here) {
  MaterialChoice choice{std::vector<Index>(here.cloud.position.size(), 0), {}, {}};
  for (std::size_t k = 0; k < request.inclusions.size(); ++k) {
    const std::vector<Index> chosen = select(request.inclusions[k].select, here, request);
    for (const Index i : chosen) choice.material_of[i] = static_cast<Index>(k + 1);
    choice.selected.push_back(static_cast<std::int64_t>(chosen.size()));
  }
  choice.size.resize(request.inclusions.size() + 1, 0);
  for (const Index material : choice.material_of) ++choice.size[material];
  return choice;
}

std::vector<MaterialGroup> material_groups(const BodyRequest& request,
                                           std::span<const std::int64_t> size,
                                           std::span<const std::int64_t> selected, const Box& box) {
  for (std::size_t k = 0; k < request.inclusions.size(); ++k) {
    if (selected[k] == 0) refuse_selection(request.inclusions[k].select, request.name, box);
  }
  if (size[0] == 0 && !request.inclusions.empty()) {
    throw InputError(fmt::format(
        "{}: body \"{}\": no phyxel is left of its own material; allowed are inclusions that "
        "leave some, or that material as the body's",
        request.inclusions[0].select.where, request.name));
  }
  std::vector<MaterialGroup> groups;
  Index end = 0;
  for (std::size_t k = 0; k < size.size(); ++k) {
    const Index begin = end;
    end += static_cast<Index>(size[k]);
    if (begin == end && k > 0) continue;
    groups.push_back(
        {static_cast<Index>(k), k == 0 ? request.material : request.inclusions[k - 1].material,
         k == 0 ? request.name : fmt::format("{}, inclusion {}", request.name, k), begin, end});
  }
  return groups;
}

void refuse_inclusions(const BodyRequest& request, const char* why, const char* allowed) {
  throw InputError(fmt::format("{}: body \"{}\" has inclusions, {}: allowed is {}",
                               request.inclusions[0].select.where, request.name, why, allowed));
}

SortedCloud sort_by_material(const BodyRequest& request, const Cloud& cloud) {
  const std::size_t n = cloud.position.size();
  const MaterialChoice choice = choose_materials(request, {cloud, {}, static_cast<Index>(n)});
  SortedCloud sorted{
      cloud, std::vector<Index>(n),
      material_groups(request, choice.size, choice.selected, box_around(cloud.position))};
  std::vector<Index> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = static_cast<Index>(i);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return choice.material_of[a] < choice.material_of[b]; });
  reorder(sorted.cloud, order);
  for (std::size_t k = 0; k < n; ++k) sorted.place[order[k]] = static_cast<Index>(k);
  return sorted;
}

}  // namespace phyxel
