#include "mpi/build_share.hpp"

#include <fmt/format.h>

#include <utility>

#include "model/assembly.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"
#include "shapes/lattice_shapes.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

BuiltShare built(const ShareSetup& setup, const Pieces& piece) {
  const MpiCommunicator& ranks = setup.ranks;
  WholeBodies whole;
  whole.bodies.resize(setup.scene.bodies.size());
  MigratingPhyxels own =
      in_stage("making phyxels", [&] { return make_pieces(setup, piece, whole); });
  whole.boxes = boxes_of(ranks, own, whole.bodies.size());
  count_bodies(setup, whole);
  std::vector<Index> sizes;
  for (const WholeBody& body : whole.bodies) sizes.push_back(body.size);
  own = in_stage("ordering along the curve", [&] {
    return migrate_along_curve(ranks, std::move(own), sizes, whole.boxes, whole.group_size);
  });
  in_stage("spacings", [&] { find_spacings(setup, whole, own); });
  find_supports(setup, whole, own);
  Cut cut = in_stage("partition", [&] { return partition(setup, whole, own); });
  own = in_stage("sending to owners",
                 [&] { return migrate_to_owners(ranks, std::move(own), std::move(cut.owner)); });
  LocalModel local =
      in_stage("lists", [&] { return surroundings_of(setup, whole, std::move(own)); });
  in_stage("masses, moments, boundary, surfels", [&] { complete_model(setup, whole, local); });
  BuiltShare share = in_stage("share", [&] { return share_out_of(setup, whole, cut, local); });
  share.digest = model_digest(share.model);
  share.digest_before_4 = model_digest_before_4(share.model);
  return share;
}

/// Bodies begin on one rank after the other, so that small ones are not all the first one's.
Piece piece_of(const MpiCommunicator& ranks, std::size_t body) {
  const auto size = static_cast<std::size_t>(ranks.size());
  return {static_cast<int>((static_cast<std::size_t>(ranks.rank()) + body) % size), ranks.size()};
}

}  // namespace

BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const ShareOptions& options) {
  if (needs_whole(scene)) {
    return share_of_whole(ranks, options, [&] { return build_model(scene); });
  }
  // Copies of a body follow one another; making one serves them all.
  const BodySource* made = nullptr;
  Cloud rest;
  const auto piece_of_source = [&](const BodyRequest& request, Piece piece, std::uint64_t& digest) {
    CloudPiece cut;
    if (const auto lattice = lattice_of(request.source, piece)) {
      cut = make_lattice_shape(*lattice, piece);
    } else {
      if (!made || !(*made == request.source)) {
        rest = rest_cloud(request.source);
        digest = 31 * digest + cloud_digest(rest);
      }
      made = &request.source;
      cut = cut_piece(rest, piece);
      cut.cloud.warnings = std::exchange(rest.warnings, {});  // once for all copies
    }
    place(cut.cloud, request);
    return cut;
  };
  return naming(scene, [&] {
    return built({ranks, scene, options}, [&](std::size_t b, std::uint64_t& digest) {
      const BodyRequest& request = scene.bodies[b];
      return naming(request, [&] { return piece_of_source(request, piece_of(ranks, b), digest); });
    });
  });
}

BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const std::vector<Cloud>& clouds, const ShareOptions& options) {
  if (needs_whole(scene)) {
    return share_of_whole(ranks, options, [&] { return build_model(scene, clouds); });
  }
  return naming(scene, [&] {
    if (clouds.size() != scene.bodies.size()) {
      throw AgreedError(ExitCode::bad_input,
                        fmt::format("{} clouds for a scene of {} bodies: one each is allowed",
                                    clouds.size(), scene.bodies.size()));
    }
    return built({ranks, scene, options}, [&](std::size_t b, std::uint64_t& digest) {
      digest = 31 * digest + cloud_digest(clouds[b]);
      naming(scene.bodies[b], [&] { check_cloud(scene.bodies[b], clouds[b]); });
      CloudPiece cut = cut_piece(clouds[b], piece_of(ranks, b));
      cut.cloud.warnings = clouds[b].warnings;
      return cut;
    });
  });
}

}  // namespace phyxel
