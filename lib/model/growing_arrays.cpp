#include "model/growing_arrays.hpp"

#include <algorithm>
#include <new>

namespace phyxel {
namespace {

/// Calls use(array) for each of the arrays.
template <class AnyModel, class Use>
void for_each_array(AnyModel& model, Use&& use) {
  auto& surfels = model.surfels;
  auto &lists = model.neighbourhood.neighbours, &carriers = surfels.carriers;
  const auto use_all = [&](auto&... arrays) { (use(arrays), ...); };
  use_all(model.position, model.volume, model.mass, model.neighbourhood.support, lists.offsets,
          lists.indices, surfels.position, surfels.normal, surfels.triangle, carriers.offsets,
          carriers.indices);
}

}  // namespace

std::vector<std::size_t> sizes_of(const Model& model) {
  std::vector<std::size_t> sizes;
  for_each_array(model, [&](const auto& array) { sizes.push_back(array.size()); });
  return sizes;
}

void reserve_for_copies(Model& model, std::span<const std::size_t> before, std::size_t copies) {
  std::size_t k = 0;
  for_each_array(model, [&](auto& array) {
    const std::size_t added = array.size() - before[k++], wanted = array.size() + copies * added;
    if (wanted <= array.capacity()) return;
    try {
      array.reserve(std::max(wanted, 2 * array.capacity()));  // for other bodies, too
    } catch (const std::bad_alloc&) {  // what does not fit is told body by body
    }
  });
}

}  // namespace phyxel
