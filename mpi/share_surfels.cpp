#include <algorithm>
#include <utility>

#include "model/assembly.hpp"
#include "model/neighbour_search.hpp"
#include "mpi/share_pipeline.hpp"

namespace phyxel {

Unreached nearest_to_unreached(const ShareSetup& setup, const WholeBodies& whole,
                               const LocalModel& local, std::size_t b,
                               std::span<const Vec3d> points, const std::vector<char>& reached) {
  std::vector<std::int64_t> ranks_that_reach(reached.begin(), reached.end());
  setup.ranks.add(ranks_that_reach);
  std::vector<Vec3d> own;
  std::vector<Index> own_at;
  for (Index i = local.bodies[b].begin; i < local.bodies[b].end; ++i) {
    if (!owns(local, static_cast<std::size_t>(i))) continue;
    own.push_back(local.phyxels[i].position);
    own_at.push_back(i);
  }
  struct Nearest {
    double squared;
    std::int64_t number;  ///< Global id.
    bool operator<(const Nearest& other) const {
      return squared != other.squared ? squared < other.squared : number < other.number;
    }
  };
  std::vector<Index> unreached;
  for (std::size_t s = 0; s < points.size(); ++s) {
    if (ranks_that_reach[s] == 0) unreached.push_back(static_cast<Index>(s));
  }
  std::vector<Index> at(unreached.size());
  std::vector<Nearest> nearest(unreached.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t u = 0; u < unreached.size(); ++u) {
    const auto [squared, k] = nearest_to(points[unreached[u]], own);
    at[u] = k < 0 ? -1 : own_at[k];
    nearest[u] = {squared, k < 0 ? INT64_MAX : global_id_of(whole, local, own_at[k])};
  }
  const std::vector<Nearest> of_ranks = setup.ranks.gathered(std::span(std::as_const(nearest)));
  Unreached found{static_cast<Index>(unreached.size()), std::vector<Index>(points.size(), -1)};
  for (std::size_t u = 0; u < unreached.size(); ++u) {
    bool first = at[u] >= 0;
    for (std::size_t k = u; k < of_ranks.size(); k += unreached.size()) {
      if (of_ranks[k] < nearest[u]) first = false;
    }
    if (first) found.carriers[unreached[u]] = at[u];
  }
  return found;
}

/// The surfels whose first carrier this rank owns.
void add_surfels(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  Model& m = local.model;
  Index base = 0;
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const Surface& surface = whole.surfaces[b];
    const Range& body = local.bodies[b];
    const auto all = static_cast<Index>(surface.position.size());
    const auto surfel_begin = static_cast<Index>(local.surfel_id.size());
    if (all > 0) {
      const auto begin = static_cast<std::size_t>(body.begin);
      const Csr rows = phyxels_reaching(surface.position, of_range(m.position, body),
                                        of_range(m.neighbourhood.support, body));
      // The owner of a surfel's first carrier has all carriers.
      std::vector<char> here(static_cast<std::size_t>(all), 0);
      std::int64_t found = 0;
      for (Index s = 0; s < all; ++s) {
        here[s] = rows.length(s) > 0 &&
                  owns(local, begin + static_cast<std::size_t>(rows.row(s).front()));
        found += here[s];
      }
      Unreached unreached;
      if (setup.ranks.sum(found) < all) {
        unreached = nearest_to_unreached(setup, whole, local, b, surface.position, here);
      }
      const std::vector<Index>& nearest = unreached.carriers;
      m.surfels.unreached += unreached.points;
      for (Index s = 0; s < all; ++s) {
        const bool lone = !nearest.empty() && nearest[s] >= 0;
        if (!here[s] && !lone) continue;
        local.surfel_id.push_back(base + s);
        m.surfels.position.push_back(surface.position[s]);
        m.surfels.normal.push_back(surface.normal[s]);
        if (lone) m.surfels.carriers.indices.push_back(nearest[s]);
        if (!lone) {
          for (const Index i : rows.row(s)) {
            m.surfels.carriers.indices.push_back(body.begin + i);
          }
        }
        m.surfels.carriers.offsets.push_back(
            static_cast<Offset>(m.surfels.carriers.indices.size()));
      }
    }
    // A body's surfels belong to its first part.
    for (std::size_t q = whole.bodies[b].first_part;
         q < m.parts.size() && m.parts[q].body == static_cast<Index>(b); ++q) {
      m.parts[q].surfel_end = static_cast<Index>(local.surfel_id.size());
      m.parts[q].surfel_begin =
          q == whole.bodies[b].first_part ? surfel_begin : m.parts[q].surfel_end;
    }
    base += all;
  }
}

}  // namespace phyxel
