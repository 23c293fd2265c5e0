/// The stages of the set-up of shares: free functions over plain values, in the order in which
/// `build_share` calls them. Every one is collective.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "model/box.hpp"
#include "model/cloud_piece.hpp"
#include "model/share_surveyor.hpp"
#include "mpi/build_share.hpp"
#include "mpi/migrate.hpp"

namespace phyxel {

/// What the set-up of a share is given.
struct ShareSetup {
  const MpiCommunicator& ranks;
  const Scene& scene;
  const ShareOptions& options;
};

/// What all ranks know of a body.
struct WholeBody {
  Index size = 0;   ///< Phyxels.
  Index base = 0;   ///< Global id of its first phyxel.
  Index group = 0;  ///< Group of its first phyxel.
  Index tile = 0;   ///< Tile of its first phyxel.
  Vec3d origin;     ///< Its first phyxel at rest [m].
  bool kernel_volumes = false;
  std::vector<std::string> regions;  ///< Names; those used have the first bits.
  std::size_t used_regions = 0;
  double reach = 0;  ///< The largest support [m].
};

/// What all ranks know of all bodies.
struct WholeBodies {
  std::vector<WholeBody> bodies;
  std::vector<Box> boxes;             ///< Of the phyxels of each body.
  std::vector<Surface> surfaces;      ///< Of each body, whole.
  std::vector<std::string> warnings;  ///< Of the clouds, which every rank makes: alike on all.
  Index size = 0;                     ///< Phyxels of the whole model.
  Index groups = 0, group_size = 1;   ///< Phyxels along the curve that stay together.
};

/// Who owns each own phyxel from now on, and how well that cuts the model.
struct Cut {
  Bulk<int> owner;
  Partitioner partitioner = Partitioner::metis;
  PartitionQuality quality;
};

/// A rank's own phyxels and all around them: the whole model, as far as `share_of` is concerned.
/// Lists, unless they are left to a device, are whole for own phyxels and for their neighbours.
struct LocalModel {
  MigratingPhyxels phyxels;
  std::vector<int> owner;  ///< The rank of each phyxel.
  Model model;
  std::vector<Around> around;    ///< [body]
  std::vector<Index> surfel_id;  ///< Global ids of the surfels that this rank moves.
  int rank = 0;                  ///< This one.
};
/// True if phyxel i is no ghost.
inline bool owns(const LocalModel& local, std::size_t i) { return local.owner[i] == local.rank; }
/// The index of phyxel i in the whole model.
inline Index global_id_of(const WholeBodies& whole, const LocalModel& local, Index i) {
  return whole.bodies[local.phyxels[i].body].base + local.phyxels[i].number;
}

/// Makes this rank's piece of a body. @param digest of the whole cloud, if this rank has it
using Pieces = std::function<CloudPiece(std::size_t body, std::uint64_t& digest)>;

/// The phyxels of this rank's pieces. Sets bodies, surfaces and warnings of `whole`.
/// @throws AgreedError for what `build_model` refuses, and for bodies that differ between ranks
MigratingPhyxels make_pieces(const ShareSetup& setup, const Pieces& piece, WholeBodies& whole);
/// Numbers the phyxels, groups and tiles of bodies.
void count_bodies(const ShareSetup& setup, WholeBodies& whole);

/// Finds the spacing of own phyxels: asks farther and farther around until the nearest are there.
void find_spacings(const ShareSetup& setup, const WholeBodies& whole, MigratingPhyxels& own);
/// Finds the support of own phyxels, and the largest of each body.
void find_supports(const ShareSetup& setup, WholeBodies& whole, MigratingPhyxels& own);

/// Partitions the groups of phyxels. @param own along the curve
Cut partition(const ShareSetup& setup, const WholeBodies& whole, const MigratingPhyxels& own);

/// Adds what surrounds own phyxels, as far as the neighbours of ghosts and the carriers of surfels,
/// and finds the lists.
LocalModel surroundings_of(const ShareSetup& setup, const WholeBodies& whole, MigratingPhyxels own);
/// Finds masses, moments, boundary conditions and surfels.
void complete_model(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local);
/// Adds the surfels whose first carrier is an own phyxel.
void add_surfels(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local);

/// Takes the share out of the local model, and connects it with the other ranks.
BuiltShare share_out_of(const ShareSetup& setup, WholeBodies& whole, const Cut& cut,
                        LocalModel& local);

/// Refuses digests that differ between ranks. Collective.
/// @param digest of what each rank has made or read for itself
/// @throws AgreedError
void check_alike(const MpiCommunicator& ranks, std::uint64_t digest);

/// True for scenes whose shares are taken out of whole models: a body has closed gradients, whose
/// closing vectors one rank has to find, or inclusions.
bool needs_whole(const Scene& scene);
/// Takes this rank's share out of the model that each rank builds whole. Collective.
/// @throws AgreedError for what `build` refuses, and for models that differ between ranks
BuiltShare share_of_whole(const MpiCommunicator& ranks, const ShareOptions& options,
                          const std::function<Model()>& build);

/// Other ranks' phyxels within so many supports of own ones.
RemotePhyxels remote_phyxels_within(const ShareSetup& setup, const WholeBodies& whole,
                                    const MigratingPhyxels& own, double supports);
/// The phyxels of one body. @param phyxels in the order of bodies
std::span<const MigratingPhyxel> of_body(const MigratingPhyxels& phyxels, std::size_t b);
/// The values of the phyxels of a part.
template <class T>
std::span<const typename T::value_type> of_part(const T& values, const Part& part) {
  return std::span(values).subspan(static_cast<std::size_t>(part.begin),
                                   static_cast<std::size_t>(part.end - part.begin));
}

}  // namespace phyxel
