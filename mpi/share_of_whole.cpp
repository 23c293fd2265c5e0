#include "model/space_filling_curve.hpp"
#include "mpi/halo_transport.hpp"
#include "mpi/share_pipeline.hpp"
#include "partition/share.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// The place of each phyxel in the whole model's tiles, shape [n].
std::vector<Index> places_of(const Model& whole, const Groups& tiles, int tile) {
  std::vector<Index> place(static_cast<std::size_t>(whole.size()));
  Index next = 0;  // tile
  for (const Part& part : whole.parts) {
    std::vector<Index> order = curve_order(whole.position, part.begin, part.end);
    for (auto first = order.begin(); first != order.end(); ++next) {
      auto last = first;
      while (last != order.end() && tiles.of[*last] == next) ++last;
      order_in_tile(std::span(first, last),
                    [&](Index i) { return whole.neighbourhood.neighbours.length(i); });
      for (Index k = 0; first != last; ++first, ++k) place[*first] = next * tile + k;
    }
  }
  return place;
}

/// The surfaces of all bodies as one, in which triangles have the whole model's numbers.
Surface surface_of(const Model& whole) {
  const Surfels& surfels = whole.surfels;
  return {.position = surfels.position, .normal = surfels.normal, .triangle = surfels.triangle};
}

}  // namespace

bool needs_whole(const Scene& scene) {
  for (const BodyRequest& body : scene.bodies) {
    if (body.closure > 0 || !body.inclusions.empty()) return true;
  }
  return false;
}

BuiltShare share_of_whole(const MpiCommunicator& ranks, const ShareOptions& options,
                          const std::function<Model()>& build) {
  const Model whole = ranks.agreed(build);
  BuiltShare built;
  built.digest = model_digest(whole);
  built.digest_before_4 = model_digest_before_4(whole);
  check_alike(ranks, built.digest);
  return in_stage("share", [&] {
    const Graph graph = phyxel_graph(whole);
    Groups tiles;
    if (options.tile > 0) tiles = curve_groups(whole, options.tile);
    ChosenPartition chosen;
    // METIS takes random numbers from the C library: one rank's answer serves all.
    ranks.collectively([&] {
      if (ranks.rank() > 0) return;
      chosen = choose_partition(graph, options.tile > 0 ? &tiles : nullptr, ranks.size(),
                                options.candidates);
    });
    chosen.part_of = ranks.broadcast(std::move(chosen.part_of));
    built.partitioner = ranks.broadcast(std::vector{chosen.partitioner}).front();
    built.quality = ranks.broadcast(std::vector{chosen.quality}).front();
    const auto rank = static_cast<std::size_t>(ranks.rank());
    ModelShare made = ranks.agreed([&] {
      ModelShare share = share_of(whole, make_part_halos(graph, chosen.part_of, ranks.size())[rank],
                                  chosen.part_of);
      if (options.tile > 0) {
        share.share.place = values_of(share.share, places_of(whole, tiles, options.tile));
      }
      return share;
    });
    connect(ranks, made);
    built.model = model_of(std::move(made));
    built.surfaces = {surface_of(whole)};
    return std::move(built);
  });
}

}  // namespace phyxel
