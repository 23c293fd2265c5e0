#include <algorithm>
#include <tuple>
#include <utility>

#include "model/assembly.hpp"
#include "model/body_contact.hpp"
#include "model/contact.hpp"
#include "model/fracture.hpp"
#include "model/owned_vectors.hpp"
#include "model/space_filling_curve.hpp"
#include "mpi/halo_transport.hpp"
#include "mpi/share_pipeline.hpp"
#include "parallel_sort.hpp"
#include "partition/share.hpp"
#include "phyxel/error.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Returns the slots of own phyxels in the tiles of the whole model; -1 for ghosts.
/// @param share whose global ids are still indices of `local`
std::vector<Index> own_places(const ShareSetup& setup, const WholeBodies& whole,
                              const LocalModel& local, const Share& share) {
  std::vector<Index> place(share.global_id.size(), -1);
  if (setup.options.tile == 0) return place;
  const auto phyxel = [&](Index k) -> const MigratingPhyxel& {
    return local.phyxels[share.global_id[k]];
  };
  // (part, index along the curve, index in the share)
  const std::vector<Index> owned =
      chosen(0, static_cast<Index>(place.size()), [&](Index k) { return share.owned[k]; });
  auto sorted = in_bulk(owned.size(), [&](std::size_t k) {
    const MigratingPhyxel& p = phyxel(owned[k]);
    return std::tuple(whole.part_of(p), p.along, owned[k]);
  });
  parallel_sort(sorted);
  auto own = in_bulk(sorted.size(), [&](std::size_t k) { return std::get<2>(sorted[k]); });
  const auto tile_of = [&](std::size_t k) {
    return whole.parts[std::get<0>(sorted[k])].tile + std::get<1>(sorted[k]) / setup.options.tile;
  };
  const auto n = static_cast<Index>(own.size());
  std::vector<Index> begin = chosen(0, n, [&](Index k) {  // of each tile
    const auto at = static_cast<std::size_t>(k);
    return at == 0 || tile_of(at) != tile_of(at - 1);
  });
  begin.push_back(n);
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t t = 0; t < begin.size() - 1; ++t) {
    const auto first = static_cast<std::size_t>(begin[t]);
    const auto last = static_cast<std::size_t>(begin[t + 1]);
    order_in_tile(std::span(own).subspan(first, last - first), [&](Index k) {
      const Index i = share.global_id[k], b = phyxel(k).body;
      return local.around[b].length[i - local.bodies[b].begin];
    });
    for (std::size_t k = first; k < last; ++k) {
      place[own[k]] = tile_of(first) * setup.options.tile + static_cast<Index>(k - first);
    }
  }
  return place;
}

/// Adds what the bodies of a share may touch. @param offset of its phyxels (`contact_offset`) [m]
void add_contact(const ShareSetup& setup, const WholeBodies& whole, std::span<const double> offset,
                 Model& model) {
  add_contact_layer(model, offset);
  set_fields(model);
  const std::vector<LayerSupports> supports = add_body_layer(model, setup.scene, offset);
  setup.ranks.collectively([&] {
    add_body_surfaces(model, setup.scene, supports,
                      [&](std::size_t body) { return whole.surfaces[body]; });
  });
  for (const std::string& problem :
       {overlap_at_start(model, setup.scene), bodies_overlap_at_start(model, setup.scene)}) {
    setup.ranks.collectively([&] {
      if (!problem.empty()) throw InputError(problem);
    });
  }
}

}  // namespace

BuiltShare share_out_of(const ShareSetup& setup, WholeBodies& whole, const Cut& cut,
                        LocalModel& local) {
  PartHalo plan;
  plan.part = setup.ranks.rank();
  const auto n = static_cast<Index>(local.phyxels.size());
  const auto own = [&](Index i) { return owns(local, static_cast<std::size_t>(i)); };
  plan.owned = chosen(0, n, own);
  std::vector<Index>& ring = plan.ghosts;
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    const Range& body = local.bodies[b];
    const std::vector<Index> needed = chosen(body.begin, body.end, [&](Index i) {
      return !own(i) && local.around[b].needed[i - body.begin];
    });
    ring.insert(ring.end(), needed.begin(), needed.end());
  }
  ModelShare made = share_of(local.model, plan, local.owner);
  Share& share = made.share;
  std::vector<Index> place = own_places(setup, whole, local, share);
  std::vector<Vec3d> areas;
  if (!local.areas.empty()) areas = values_of(share, local.areas);
  std::vector<double> contact_offset;
  if (!local.contact_offset.empty()) contact_offset = values_of(share, local.contact_offset);
  share.global_count = whole.size;
  share.global_id = tabulated(share.global_id.size(), [&](std::size_t k) {
    return global_id_of(whole, local, share.global_id[k]);
  });
  for (Index& surfel : share.global_surfel_id) surfel = local.surfel_id[surfel];
  local = LocalModel();  // makes room for what closing gradients takes
  connect(setup.ranks, made);
  if (setup.options.tile > 0) {
    refresh_ghosts(share, place);
    share.place = std::move(place);
  }
  refresh_ghosts(share, made.model.mass);
  refresh_ghosts(share, made.model.volume);
  BuiltShare built;
  built.model = model_of(std::move(made));
  std::size_t surfels = 0;
  for (const Surface& surface : whole.surfaces) surfels += surface.position.size();
  built.model.warnings = whole.warnings;
  close_share(whole, built.model, areas, setup.options.close);
  setup.ranks.collectively([&] { built.model.obstacles = obstacles_of(setup.scene); });
  if (!contact_offset.empty()) add_contact(setup, whole, contact_offset, built.model);
  setup.ranks.collectively([&] { find_fracture(built.model, setup.scene); });
  add_warnings(built.model, surfels);
  built.partitioner = cut.partitioner;
  built.quality = cut.quality;
  built.surfaces = std::move(whole.surfaces);
  return built;
}

}  // namespace phyxel
