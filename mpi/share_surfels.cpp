#include <algorithm>
#include <utility>

#include "model/assembly.hpp"
#include "model/neighbour_search.hpp"
#include "mpi/share_pipeline.hpp"

namespace phyxel {
namespace {

/// For surfels beyond every support, of which the nearest phyxel is here: that phyxel; else -1.
std::vector<Index> carriers_of_unreached(const ShareSetup& setup, const WholeBodies& whole,
                                         LocalModel& local, std::size_t b,
                                         const std::vector<char>& here) {
  const Surface& surface = whole.surfaces[b];
  const Part& part = local.model.parts[b];
  std::vector<std::int64_t> reached(here.begin(), here.end());
  setup.ranks.add(reached);
  std::vector<Vec3d> own;
  std::vector<Index> own_at;
  for (Index i = part.begin; i < part.end; ++i) {
    if (!owns(local, static_cast<std::size_t>(i))) continue;
    own.push_back(local.phyxels[i].position);
    own_at.push_back(i);
  }
  struct Nearest {
    double squared;
    std::int64_t number;  ///< In the whole model.
    bool operator<(const Nearest& other) const {
      return squared != other.squared ? squared < other.squared : number < other.number;
    }
  };
  std::vector<Index> unreached;
  for (std::size_t s = 0; s < reached.size(); ++s) {
    if (reached[s] == 0) unreached.push_back(static_cast<Index>(s));
  }
  std::vector<Index> at(unreached.size());
  std::vector<Nearest> nearest(unreached.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t u = 0; u < unreached.size(); ++u) {
    const auto [squared, k] = nearest_to(surface.position[unreached[u]], own);
    at[u] = k < 0 ? -1 : own_at[k];
    nearest[u] = {squared, k < 0 ? INT64_MAX : global_id_of(whole, local, own_at[k])};
  }
  local.model.surfels.unreached += static_cast<Index>(unreached.size());
  const std::vector<Nearest> of_ranks = setup.ranks.gathered(std::span(std::as_const(nearest)));
  std::vector<Index> carriers(reached.size(), -1);
  for (std::size_t u = 0; u < unreached.size(); ++u) {
    bool first = at[u] >= 0;
    for (std::size_t k = u; k < of_ranks.size(); k += unreached.size()) {
      if (of_ranks[k] < nearest[u]) first = false;
    }
    if (first) carriers[unreached[u]] = at[u];
  }
  return carriers;
}

}  // namespace

/// Surfels that this rank moves.
void add_surfels(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  Index base = 0;
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const Surface& surface = whole.surfaces[b];
    Part& part = m.parts[b];
    const auto all = static_cast<Index>(surface.position.size());
    part.surfel_begin = static_cast<Index>(local.surfel_id.size());
    if (all > 0) {
      const auto size = static_cast<std::size_t>(part.end - part.begin);
      const auto begin = static_cast<std::size_t>(part.begin);
      const std::span<const Vec3d> position = std::span(m.position).subspan(begin, size);
      Csr rows = phyxels_reaching(surface.position, position,
                                  std::span(m.neighbourhood.support).subspan(begin, size));
      // Who has a surfel's first carrier knows all of them.
      std::vector<char> here(static_cast<std::size_t>(all), 0);
      std::int64_t found = 0;
      for (Index s = 0; s < all; ++s) {
        here[s] = rows.length(s) > 0 &&
                  owns(local, begin + static_cast<std::size_t>(rows.row(s).front()));
        found += here[s];
      }
      const std::vector<Index> nearest = setup.ranks.sum(found) < all
                                             ? carriers_of_unreached(setup, whole, local, b, here)
                                             : std::vector<Index>();
      for (Index s = 0; s < all; ++s) {
        const bool lone = !nearest.empty() && nearest[s] >= 0;
        if (!here[s] && !lone) continue;
        local.surfel_id.push_back(base + s);
        m.surfels.position.push_back(surface.position[s]);
        m.surfels.normal.push_back(surface.normal[s]);
        if (lone) m.surfels.carriers.indices.push_back(nearest[s]);
        if (!lone) {
          for (const Index i : rows.row(s)) {
            m.surfels.carriers.indices.push_back(part.begin + i);
          }
        }
        m.surfels.carriers.offsets.push_back(
            static_cast<Offset>(m.surfels.carriers.indices.size()));
      }
    }
    part.surfel_end = static_cast<Index>(local.surfel_id.size());
    base += all;
  }
}

}  // namespace phyxel
