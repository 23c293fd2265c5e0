#include "mpi/build_share.hpp"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "model/assembly.hpp"
#include "model/closing_areas.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"
#include "shapes/lattice_shapes.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Sorts the phyxels of all parts along Hilbert's curve (`migrate_along_curve`).
MigratingPhyxels along_curve(const ShareSetup& setup, const WholeBodies& whole,
                             MigratingPhyxels own) {
  std::vector<Index> sizes;
  for (const WholePart& part : whole.parts) sizes.push_back(part.size());
  const auto part_of = [&](const MigratingPhyxel& p) { return whole.part_of(p); };
  const bool sorted = whole.parts.size() > whole.bodies.size();
  const std::vector<Box> boxes =
      sorted ? boxes_of(setup.ranks, own, whole.parts.size(), part_of) : whole.boxes;
  return migrate_along_curve(setup.ranks, std::move(own), part_of, sizes, boxes, whole.group_size);
}

BuiltShare built(const ShareSetup& setup, const Pieces& piece) {
  const MpiCommunicator& ranks = setup.ranks;
  WholeBodies whole;
  whole.bodies.resize(setup.scene.bodies.size());
  MigratingPhyxels own =
      in_stage("making phyxels", [&] { return make_pieces(setup, piece, whole); });
  count_bodies(setup, whole);
  own = in_stage("ordering along the curve",
                 [&] { return along_curve(setup, whole, std::move(own)); });
  in_stage("spacings", [&] { find_spacings(setup, whole, own); });
  find_supports(setup, whole, own);
  Cut cut = in_stage("partition", [&] { return partition(setup, whole, own); });
  own = in_stage("sending to owners",
                 [&] { return migrate_to_owners(ranks, std::move(own), std::move(cut.owner)); });
  LocalModel local =
      in_stage("lists", [&] { return surroundings_of(setup, whole, std::move(own)); });
  in_stage("masses, moments, boundary, surfels", [&] { complete_model(setup, whole, local); });
  BuiltShare share = in_stage("share", [&] { return share_out_of(setup, whole, cut, local); });
  share.digest = model_digest(share.model, share.surfaces);
  share.digest_before_4 = model_digest_before_4(share.model, share.surfaces);
  return share;
}

/// Returns options for a scene: without a surveyor if a body needs lists on the host.
ShareOptions options_for(const Scene& scene, const ShareOptions& options) {
  ShareOptions own = options;
  for (const BodyRequest& body : scene.bodies) {
    if (needs_lists_on_host(body)) own.surveyor = nullptr;
  }
  return own;
}

/// Returns this rank's piece of a body. The first piece of each body goes to another rank, so that
/// small bodies do not all end on the first.
Piece piece_of(const MpiCommunicator& ranks, std::size_t body) {
  const auto size = static_cast<std::size_t>(ranks.size());
  return {static_cast<int>((static_cast<std::size_t>(ranks.rank()) + body) % size), ranks.size()};
}

}  // namespace

BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const ShareOptions& options) {
  // Copies of a body follow one another and share one cloud.
  std::optional<CutSource> made;
  Cloud rest;
  const auto piece_of_source = [&](const BodyRequest& request, Piece piece, std::uint64_t& digest) {
    CloudPiece cut;
    if (const auto lattice = lattice_of(request.source, piece)) {
      cut = make_lattice_shape(*lattice, piece);
    } else {
      CutSource source = source_of(request);
      if (!made || !is_same(*made, source)) {
        rest = rest_cloud(source);
        digest = 31 * digest + cloud_digest(rest);
      }
      made = std::move(source);
      cut = cut_piece(rest, piece);
      cut.cloud.warnings = std::exchange(rest.warnings, {});  // once for all copies
    }
    place(cut.cloud, request);
    return cut;
  };
  const ShareOptions own = options_for(scene, options);
  return naming(scene, [&] {
    return built({ranks, scene, own}, [&](std::size_t b, std::uint64_t& digest) {
      const BodyRequest& request = scene.bodies[b];
      return naming(request, [&] { return piece_of_source(request, piece_of(ranks, b), digest); });
    });
  });
}

BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const std::vector<Cloud>& clouds, const ShareOptions& options) {
  ShareOptions own = options_for(scene, options);
  for (std::size_t b = 0; b < std::min(clouds.size(), scene.bodies.size()); ++b) {
    if (needs_lists_on_host(scene.bodies[b], clouds[b])) own.surveyor = nullptr;
  }
  return naming(scene, [&] {
    if (clouds.size() != scene.bodies.size()) {
      throw AgreedError(ExitCode::bad_input,
                        fmt::format("{} clouds for a scene of {} bodies: one each is allowed",
                                    clouds.size(), scene.bodies.size()));
    }
    return built({ranks, scene, own}, [&](std::size_t b, std::uint64_t& digest) {
      digest = 31 * digest + cloud_digest(clouds[b]);
      naming(scene.bodies[b], [&] { check_cloud(scene.bodies[b], clouds[b]); });
      CloudPiece cut = cut_piece(clouds[b], piece_of(ranks, b));
      cut.cloud.warnings = clouds[b].warnings;
      return cut;
    });
  });
}

}  // namespace phyxel
