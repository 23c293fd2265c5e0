#include <algorithm>
#include <utility>

#include "model/closing_areas.hpp"
#include "model/closure.hpp"
#include "model/loads.hpp"
#include "model/neighbour_search.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// The facets near own phyxels, in the order of the surface, and the phyxels of the local body
/// among which the area of each is divided.
struct NearFacets {
  std::vector<Facet> facets;
  std::vector<Index> number;  ///< Index of each in the whole list.
  Csr near;
};

/// The numbers of the facets within reach of the box of own phyxels.
std::vector<Index> facets_around(const LocalModel& local, const Range& body, double reach,
                                 const std::vector<Facet>& all) {
  std::vector<Vec3d> own;
  for (Index i = body.begin; i < body.end; ++i) {
    if (owns(local, static_cast<std::size_t>(i))) own.push_back(local.model.position[i]);
  }
  const Box box = box_around(own);
  return chosen(0, static_cast<Index>(all.size()), [&](Index f) {
    const Vec3d x = all[f].centroid;
    return !own.empty() && x.x > box.low.x - reach && x.x < box.high.x + reach &&
           x.y > box.low.y - reach && x.y < box.high.y + reach && x.z > box.low.z - reach &&
           x.z < box.high.z + reach;
  });
}

NearFacets facets_near(const ShareSetup& setup, const WholeBodies& whole, const LocalModel& local,
                       std::size_t b, const std::vector<Facet>& all) {
  const Range& body = local.bodies[b];
  const std::vector<Index> which = facets_around(local, body, whole.bodies[b].reach, all);
  const std::vector<Vec3d> centroids =
      tabulated(which.size(), [&](std::size_t k) { return all[which[k]].centroid; });
  const Csr rows = phyxels_reaching(centroids, of_range(local.model.position, body),
                                    of_range(local.model.neighbourhood.support, body));
  // A rank that owns one of the phyxels near a facet has all of them; the owner of the first counts
  // the facet.
  std::vector<char> reached(all.size(), 0);
  std::int64_t counted = 0;
  const auto owned = [&](Index i) { return owns(local, static_cast<std::size_t>(body.begin + i)); };
  for (std::size_t k = 0; k < which.size(); ++k) {
    const auto row = rows.row(static_cast<Index>(k));
    reached[which[k]] = std::any_of(row.begin(), row.end(), owned);
    counted += !row.empty() && owned(row.front());
  }
  std::vector<Index> nearest(all.size(), -1);
  if (setup.ranks.sum(counted) < static_cast<std::int64_t>(all.size())) {
    const std::vector<Vec3d> points =
        tabulated(all.size(), [&](std::size_t f) { return all[f].centroid; });
    nearest = nearest_to_unreached(setup, whole, local, b, points, reached).carriers;
  }
  NearFacets found;
  std::vector<Index>& near = found.near.indices;
  for (std::size_t f = 0, k = 0; f < all.size(); ++f) {
    const bool listed = k < which.size() && which[k] == static_cast<Index>(f);
    const auto at = static_cast<Index>(listed ? k++ : k);
    if (nearest[f] < 0 && !reached[f]) continue;
    if (reached[f]) {
      near.insert(near.end(), rows.row(at).begin(), rows.row(at).end());
    } else {
      near.push_back(nearest[f] - body.begin);
    }
    found.facets.push_back(all[f]);
    found.number.push_back(static_cast<Index>(f));
    found.near.offsets.push_back(static_cast<Offset>(near.size()));
  }
  return found;
}

bool closes(const WholeBodies& whole, std::size_t b) {
  return whole.bodies[b].closure > 0 && whole.bodies[b].size > 0;
}

}  // namespace

void add_tractions(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const BodyRequest& request = setup.scene.bodies[b];
    const Surface& surface = whole.surfaces[b];
    const Range& body = local.bodies[b];
    for (std::size_t t = 0; t < request.tractions.size(); ++t) {
      LoadedFacets loaded;
      setup.ranks.collectively([&] {
        naming(request, [&] {
          const double longest = longest_edge(facet_support(whole.bodies[b]), surface.position,
                                              surface.triangle, 0, whole.bodies[b].size);
          loaded = loaded_facets(request, request.tractions[t],
                                 {surface.position, surface.triangle, 0, surface.groups}, longest);
        });
      });
      const NearFacets here = facets_near(setup, whole, local, b, loaded.facets);
      const std::vector<Vec3d> value = tabulated(
          here.number.size(), [&](std::size_t f) { return loaded.force[here.number[f]]; });
      const std::vector<Vec3d> force =
          distribute(here.facets, value, here.near, of_range(local.model.position, body),
                     of_range(local.model.neighbourhood.support, body));
      Load& load = local.model.loads.emplace_back(traction_load(request, t, loaded));
      for (std::size_t k = 0; k < force.size(); ++k) {
        const Index i = body.begin + static_cast<Index>(k);
        if (!owns(local, static_cast<std::size_t>(i)) || force[k] == Vec3d{}) continue;
        load.phyxels.push_back(i);
        load.force.push_back(force[k]);
      }
    }
  }
}

void find_areas(const ShareSetup& setup, WholeBodies& whole, LocalModel& local) {
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    if (!closes(whole, b)) continue;
    const Surface& surface = whole.surfaces[b];
    const std::vector<Facet> facets =
        facets_of(surface.position, surface.triangle, 0,
                  longest_edge(facet_support(whole.bodies[b]), surface.position, surface.triangle,
                               0, whole.bodies[b].size));
    check_alike(setup.ranks, facets.size());
    whole.bodies[b].enclosed = enclosed_by(facets).volume;
    const NearFacets here = facets_near(setup, whole, local, b, facets);
    const Range& body = local.bodies[b];
    const std::vector<Vec3d> areas =
        areas_of_phyxels(here.facets, here.near, of_range(local.model.position, body),
                         of_range(local.model.neighbourhood.support, body));
    local.areas.resize(local.phyxels.size());
    std::copy(areas.begin(), areas.end(), local.areas.begin() + body.begin);
  }
}

void close_share(const WholeBodies& whole, Model& share, const std::vector<Vec3d>& areas,
                 const ClosingSearch& search) {
  std::vector<ClosedBody> closed;
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    if (!closes(whole, b)) continue;
    const std::size_t first = whole.bodies[b].first_part;
    const std::size_t count = share.parts_of_body(share.parts[first]).size();
    closed.push_back({std::span(share.parts).subspan(first, count), whole.bodies[b].enclosed});
  }
  if (const auto refusal = close_bodies(share, closed, areas, search ? search : search_on_host)) {
    throw AgreedError(ExitCode::bad_input, *refusal);
  }
}

}  // namespace phyxel
