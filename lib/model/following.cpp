#include "model/following.hpp"

#include <algorithm>
#include <span>

#include "model/neighbour_search.hpp"
#include "model/parts.hpp"
#include "model/point_fit.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel {
namespace {

/// The phyxels around each of some phyxels of one body, within its support.
Csr phyxels_around(const Model& model, const std::vector<Index>& phyxels) {
  Csr around;
  if (phyxels.empty()) return around;
  const auto add = [&](Index i, auto&& candidates, Index first) {
    // The gradient jumps where the material does.
    const double h = model.neighbourhood.support[i];
    std::vector<Index> row{i}, of_part{i};
    Sym3d moment;
    for (const Index of_body : candidates) {
      const Index j = first + of_body;
      const Vec3d x = model.position[j] - model.position[i];
      if (j == i || !(dot(x, x) < h * h)) continue;
      row.push_back(j);
      if (!are_of_one_part(model, i, j)) continue;
      of_part.push_back(j);
      moment += moment_term(x, weight_shape(dot(x, x), 1 / (h * h)));
    }
    if (pseudo_inverse(moment).rank == 3) row = of_part;
    // Sums have the same bits on any number of ranks.
    std::sort(row.begin(), row.end(),
              [&](Index a, Index b) { return model.global_id(a) < model.global_id(b); });
    around.indices.insert(around.indices.end(), row.begin(), row.end());
    around.offsets.push_back(static_cast<Offset>(around.indices.size()));
  };
  if (model.has_lists()) {
    for (const Index i : phyxels) add(i, model.neighbourhood.neighbours.row(i), 0);
    return around;
  }
  const std::span<const Part> parts = model.parts_of_body(part_of(model, phyxels.front()));
  const auto begin = static_cast<std::size_t>(parts.front().begin),
             count = static_cast<std::size_t>(parts.back().end) - begin;
  std::vector<Vec3d> places;
  double reach = 0;
  for (const Index i : phyxels) {
    places.push_back(model.position[i]);
    reach = std::max(reach, model.neighbourhood.support[i]);
  }
  const Csr rows = phyxels_reaching(places, std::span(model.position).subspan(begin, count),
                                    std::vector<double>(count, reach));
  for (std::size_t k = 0; k < phyxels.size(); ++k) {
    add(phyxels[k], rows.row(static_cast<Index>(k)), parts.front().begin);
  }
  return around;
}

Following following_of(const Model& model, std::size_t load) {
  Following found{.load = load};
  std::vector<Index> phyxels;
  for (std::size_t k = 0; k < model.loads[load].phyxels.size(); ++k) {
    const Index i = model.loads[load].phyxels[k];
    if (!model.owns(i)) continue;
    found.entry.push_back(k);
    phyxels.push_back(i);
  }
  found.near = phyxels_around(model, phyxels);
  found.slope.resize(found.near.indices.size());
#pragma omp parallel for schedule(dynamic, 16)
  for (std::size_t k = 0; k < phyxels.size(); ++k) {
    const std::span<const Index> row = found.near.row(static_cast<Index>(k));
    std::vector<Vec3d> places;
    for (const Index j : row) places.push_back(model.position[j]);
    const std::vector<Vec3d> slopes =
        slopes_at(model.position[phyxels[k]], places, model.neighbourhood.support[phyxels[k]]);
    std::copy(slopes.begin(), slopes.end(),
              found.slope.begin() + static_cast<std::ptrdiff_t>(found.near.offsets[k]));
  }
  return found;
}

}  // namespace

void find_following(Model& model) {
  model.following.clear();
  for (std::size_t load = 0; load < model.loads.size(); ++load) {
    if (model.loads[load].follows) model.following.push_back(following_of(model, load));
  }
}

}  // namespace phyxel
