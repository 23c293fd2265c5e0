#include "model/selection.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "model/box.hpp"
#include "phyxel/error.hpp"
#include "sort_unique.hpp"

namespace phyxel {
namespace {

template <class Inside>
std::vector<Index> indices_where(const Cloud& cloud, Inside&& inside) {
  std::vector<Index> chosen;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (inside(cloud.position[i])) chosen.push_back(static_cast<Index>(i));
  }
  return chosen;
}

std::vector<Index> of_region(const Selection& selection, const Cloud& cloud,
                             const std::string& body) {
  const auto found = cloud.regions.find(*selection.region);
  if (found != cloud.regions.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [name, members] : cloud.regions) names.push_back(name);
  throw InputError(fmt::format("{}: body \"{}\" has no region \"{}\"{}; it has: {}",
                               selection.where, body, *selection.region,
                               did_you_mean(*selection.region, names),
                               names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
}

std::vector<Index> of_indices(const Selection& selection, const Cloud& cloud,
                              const std::string& body) {
  std::vector<Index> chosen = *selection.indices;
  for (const Index i : chosen) {
    if (i < 0 || static_cast<std::size_t>(i) >= cloud.position.size()) {
      throw InputError(fmt::format("{}: phyxel {} is not in body \"{}\": allowed 0 to {}",
                                   selection.where, i, body, cloud.position.size() - 1));
    }
  }
  sort_unique(chosen);
  return chosen;
}

}  // namespace

std::vector<Index> select(const Selection& selection, const Cloud& cloud, const std::string& body) {
  std::vector<Index> chosen;
  if (selection.region) {
    chosen = of_region(selection, cloud, body);
  } else if (selection.indices) {
    chosen = of_indices(selection, cloud, body);
  } else if (selection.box) {
    const Vec3d low = selection.box->low, high = selection.box->high;
    chosen = indices_where(cloud, [&](Vec3d p) {
      return p.x >= low.x && p.x <= high.x && p.y >= low.y && p.y <= high.y && p.z >= low.z &&
             p.z <= high.z;
    });
  } else if (selection.ball) {
    const double r2 = selection.ball->radius * selection.ball->radius;
    chosen = indices_where(cloud, [&](Vec3d p) {
      return dot(p - selection.ball->centre, p - selection.ball->centre) <= r2;
    });
  } else {
    chosen = indices_where(cloud, [](Vec3d) { return true; });
  }
  if (chosen.empty()) {
    const auto [low, high] = box_around(cloud.position);
    throw InputError(fmt::format(
        "{}: this selects no phyxel of body \"{}\", whose phyxels lie in [{:g}, {:g}, {:g}] to "
        "[{:g}, {:g}, {:g}] m",
        selection.where, body, low.x, low.y, low.z, high.x, high.y, high.z));
  }
  return chosen;
}

}  // namespace phyxel
