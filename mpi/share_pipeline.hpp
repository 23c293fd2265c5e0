/// The stages of the set-up of shares: free functions over plain values, in the order in which
/// `build_share` calls them. Every one is collective.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "model/box.hpp"
#include "model/cloud_piece.hpp"
#include "model/inclusions.hpp"
#include "model/share_surveyor.hpp"
#include "model/walls.hpp"
#include "mpi/build_share.hpp"
#include "mpi/migrate.hpp"
#include "mpi/region_sets.hpp"

namespace phyxel {

/// The arguments of the set-up of a share.
struct ShareSetup {
  const MpiCommunicator& ranks;
  const Scene& scene;
  const ShareOptions& options;
};

/// Properties of a body that all ranks know.
struct WholeBody {
  Index size = 0;              ///< Number of phyxels.
  Index base = 0;              ///< Global id of its first phyxel.
  std::size_t first_part = 0;  ///< Part of the body's own material; its inclusions follow.
  Vec3d origin;                ///< Rest position of the first phyxel [m].
  bool kernel_volumes = false;
  bool lattice = false;              ///< `Cloud::lattice`.
  Walls walls;                       ///< `walls_of` its cloud.
  SupportCuts cuts;                  ///< `Cloud::cuts`.
  double closure = 0;                ///< Tolerance of closed gradients; 0: they are not closed.
  std::vector<std::string> regions;  ///< Names of its regions, those that the scene uses first.
  std::size_t used_regions = 0;
  RegionSets region_sets;  ///< Sets of regions that its phyxels are in.
  /// For bodies with inclusions: the region of each boundary entry, or -1 for an entry that selects
  /// by position. Empty for bodies of one material.
  std::vector<int> region_of_entry;
  NeighbourhoodRule rule;    ///< The scene's, resolved for the cloud.
  bool has_spacing = false;  ///< True if the cloud has spacings of its own.
  double reach = 0;          ///< Largest support [m].
  double finest = 0;         ///< Smallest support [m].
  double pair_length = 0;    ///< `Part::pair_length`.
  double enclosed = 0;       ///< Volume inside its surface, if its gradients are closed [m³].
};
/// The support that facets of a body's surface have to resolve (`facet_support`) [m].
inline double facet_support(const WholeBody& body) {
  return body.pair_length > 0 ? body.finest : body.reach;
}
/// Properties of a part, which has one material, that all ranks know.
struct WholePart {
  std::size_t body = 0;
  MaterialGroup material;  ///< Its material, and the numbers of its phyxels in the body.
  Index group = 0;         ///< First group along the curve.
  Index tile = 0;          ///< First tile.
  Index size() const { return material.end - material.begin; }
};

/// Properties of all bodies that all ranks know.
struct WholeBodies {
  std::vector<WholeBody> bodies;
  std::vector<WholePart> parts;       ///< Parts of all bodies.
  std::vector<Box> boxes;             ///< Bounding box of the phyxels of each body.
  std::vector<Surface> surfaces;      ///< Whole surface of each body.
  std::vector<std::string> warnings;  ///< Warnings of the clouds; the same on all ranks.
  Index size = 0;                     ///< Number of phyxels of the whole model.
  /// Number of groups of phyxels along the curve that stay together, and their size.
  Index groups = 0, group_size = 1;

  /// The part of a phyxel, once phyxels are numbered by material.
  std::size_t part_of(const MigratingPhyxel& p) const {
    std::size_t part = bodies[static_cast<std::size_t>(p.body)].first_part;
    while (p.number >= parts[part].material.end) ++part;
    return part;
  }
  /// The group of a phyxel, once it has its place along the curve.
  Index group_of(const MigratingPhyxel& p) const {
    return parts[part_of(p)].group + p.along / group_size;
  }
};

/// The range [begin, end) of a body in a local model.
struct Range {
  Index begin = 0, end = 0;
};

/// A partition: the new owner of each own phyxel, and the quality of the cut.
struct Cut {
  Bulk<int> owner;
  Partitioner partitioner = Partitioner::metis;
  PartitionQuality quality;
};

/// A rank's own phyxels and those around them, from which `share_of` takes the share as from the
/// whole model. Neighbour lists, unless a device makes them, are complete for own phyxels and for
/// their neighbours.
struct LocalModel {
  MigratingPhyxels phyxels;
  std::vector<int> owner;     ///< Rank of each phyxel.
  std::vector<Range> bodies;  ///< Range of each body.
  Model model;
  std::vector<Around> around;  ///< Neighbourhoods of own phyxels of each body.
  std::vector<Index>
      surfel_id;  ///< Global ids of the surfels whose first carrier is an own phyxel.
  /// Areas of own phyxels, where gradients are closed (`areas_of_phyxels`) [m²]; empty if none are.
  std::vector<Vec3d> areas;
  /// Offsets of all phyxels (`contact_offset`) [m]; empty in scenes without obstacles.
  std::vector<double> contact_offset;
  int rank = 0;  ///< This rank.
};
/// True if phyxel i is no ghost.
inline bool owns(const LocalModel& local, std::size_t i) { return local.owner[i] == local.rank; }
/// The index of phyxel i in the whole model.
inline Index global_id_of(const WholeBodies& whole, const LocalModel& local, Index i) {
  return whole.bodies[local.phyxels[i].body].base + local.phyxels[i].number;
}

/// A function that makes this rank's piece of a body.
using Pieces = std::function<CloudPiece(std::size_t body)>;

/// Returns the phyxels of this rank's pieces, in the order of the clouds. Sets bodies, parts,
/// boxes, surfaces and warnings of `whole`.
/// @throws AgreedError for what `build_model` refuses
MigratingPhyxels make_pieces(const ShareSetup& setup, const Pieces& piece, WholeBodies& whole);
/// Numbers the phyxels, groups and tiles of bodies and parts.
void count_bodies(const ShareSetup& setup, WholeBodies& whole);

/// Finds the spacing of own phyxels, from phyxels of other ranks within a growing distance.
void find_spacings(const ShareSetup& setup, const WholeBodies& whole, MigratingPhyxels& own);
/// Finds the support of own phyxels, and the largest and smallest of each body.
void find_supports(const ShareSetup& setup, WholeBodies& whole, MigratingPhyxels& own);

/// Partitions the groups of phyxels. @param own phyxels in the order of the curve
Cut partition(const ShareSetup& setup, const WholeBodies& whole, const MigratingPhyxels& own);

/// Adds the phyxels of other ranks around own ones, as far as the neighbours of ghosts and the
/// carriers of surfels, and makes the neighbour lists.
LocalModel surroundings_of(const ShareSetup& setup, const WholeBodies& whole, MigratingPhyxels own);
/// Finds masses, moments, boundary conditions, surfels and the areas that close gradients.
void complete_model(const ShareSetup& setup, WholeBodies& whole, LocalModel& local);
/// Adds the surfels whose first carrier is an own phyxel.
void add_surfels(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local);
/// Finds the areas of own phyxels of bodies with closed gradients, and the volumes inside their
/// surfaces.
void find_areas(const ShareSetup& setup, WholeBodies& whole, LocalModel& local);

/// Finds the phyxels by which bodies touch obstacles. Collective.
/// @throws AgreedError for bodies without a surface
void find_contact_layer(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local);

/// Adds the tractions of all bodies, as forces on own phyxels. Collective.
void add_tractions(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local);
/// Closes the gradients of the bodies of a connected share that ask for it.
/// @param areas of each phyxel of the share [m²]; empty if none asks
/// @throws AgreedError for what `close_gradients` refuses
void close_share(const WholeBodies& whole, Model& share, const std::vector<Vec3d>& areas,
                 const ClosingSearch& search);

/// The phyxels nearest to points that no support reaches.
struct Unreached {
  Index points = 0;             ///< Number of such points, over all ranks.
  std::vector<Index> carriers;  ///< Nearest phyxel of each point if this rank owns it, else -1.
};
/// Finds the nearest phyxel of each point that no support reaches. Collective.
/// @param reached for each point, whether it is within the support of an own phyxel
Unreached nearest_to_unreached(const ShareSetup& setup, const WholeBodies& whole,
                               const LocalModel& local, std::size_t b,
                               std::span<const Vec3d> points, const std::vector<char>& reached);

/// Takes the share out of the local model, which it releases, and connects it with the other ranks.
BuiltShare share_out_of(const ShareSetup& setup, WholeBodies& whole, const Cut& cut,
                        LocalModel& local);

/// Refuses digests that differ between ranks. Collective.
/// @param digest of what each rank was given or has made for itself
/// @throws AgreedError
void check_alike(const MpiCommunicator& ranks, std::uint64_t digest);

/// Returns the phyxels of other ranks within a number of supports of own ones.
RemotePhyxels remote_phyxels_within(const ShareSetup& setup, const WholeBodies& whole,
                                    const MigratingPhyxels& own, double supports);
/// Returns the phyxels, or other values, of one body. @param values sorted by body
template <class T>
std::span<const typename T::value_type> of_body(const T& values, std::size_t b) {
  const auto first_from = [&](std::size_t body) {
    return std::partition_point(values.begin(), values.end(), [&](const auto& value) {
      return static_cast<std::size_t>(value.body) < body;
    });
  };
  return {first_from(b), first_from(b + 1)};
}
/// Returns the values of the phyxels of a body or a part.
template <class T, class R>
std::span<const typename T::value_type> of_range(const T& values, const R& range) {
  return std::span(values).subspan(static_cast<std::size_t>(range.begin),
                                   static_cast<std::size_t>(range.end - range.begin));
}

}  // namespace phyxel
