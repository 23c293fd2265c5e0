#include "mpi/build_share.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "model/assembly.hpp"
#include "model/closing_areas.hpp"
#include "mpi/dealt_cloud.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"
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
    if (needs_lists_on_host(body) || (!own.close && may_close(body))) own.surveyor = nullptr;
  }
  return own;
}

/// Returns a rank's piece of a body. The first piece of each body goes to another rank, so that
/// small bodies do not all end on the first.
Piece piece_of(int ranks, int rank, std::size_t body) {
  const auto size = static_cast<std::size_t>(ranks);
  return {static_cast<int>((static_cast<std::size_t>(rank) + body) % size), ranks};
}

/// Makes this rank's piece of each body but of lattices, which are made piece by piece. Each rank
/// makes clouds of its own, one at a time, and deals them out.
std::vector<CloudPiece> pieces_of(const MpiCommunicator& ranks, const Scene& scene,
                                  std::vector<SharedSource> sources) {
  std::vector<CloudPiece> pieces(scene.bodies.size());
  std::erase_if(sources, [](const SharedSource& s) { return is_lattice(s.from.source); });
  const auto at_once = static_cast<std::size_t>(ranks.size());
  for (std::size_t begin = 0; begin < sources.size(); begin += at_once) {
    const std::size_t end = std::min(begin + at_once, sources.size()),
                      mine = begin + static_cast<std::size_t>(ranks.rank());
    Cloud made;
    ranks.divided(mine < end, [&] {
      naming(scene.bodies[sources[mine].bodies.front()],
             [&] { made = rest_cloud(sources[mine].from); });
    });
    for (std::size_t k = begin; k < end; ++k) {
      DealtCloud dealt(ranks, k == mine ? std::exchange(made, {}) : Cloud{},
                       static_cast<int>(k - begin));
      for (const std::size_t b : sources[k].bodies) {
        pieces[b] = dealt.piece([&](int rank) { return piece_of(ranks.size(), rank, b).number; });
      }
    }
  }
  return pieces;
}

}  // namespace

BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const ShareOptions& options) {
  const ShareOptions own = options_for(scene, options);
  return naming(scene, [&] {
    const std::vector<SharedSource> sources = ranks.agreed([&] {
      validate(scene);
      return shared_sources(scene);
    });
    std::vector<const CutSource*> source_of_body;
    for (const SharedSource& source : sources) {
      source_of_body.insert(source_of_body.end(), source.bodies.size(), &source.from);
    }
    std::vector<CloudPiece> pieces = pieces_of(ranks, scene, sources);
    return built({ranks, scene, own}, [&](std::size_t b) {
      const BodyRequest& request = scene.bodies[b];
      const Piece number = piece_of(ranks.size(), ranks.rank(), b);
      return naming(request, [&] {
        CloudPiece piece = is_lattice(request.source) ? lattice_piece(*source_of_body[b], number)
                                                      : std::move(pieces[b]);
        place(piece.cloud, request);
        return piece;
      });
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
    check_alike(ranks, ranks.agreed([&] {
      validate(scene);
      std::uint64_t digest = 0;
      for (std::size_t b = 0; b < clouds.size(); ++b) {
        naming(scene.bodies[b], [&] { check_cloud(scene.bodies[b], clouds[b]); });
        digest = 31 * digest + cloud_digest(clouds[b]);
      }
      return digest;
    }));
    return built({ranks, scene, own}, [&](std::size_t b) {
      CloudPiece cut = cut_piece(clouds[b], piece_of(ranks.size(), ranks.rank(), b));
      cut.cloud.warnings = clouds[b].warnings;
      return cut;
    });
  });
}

}  // namespace phyxel
