/// Models that ranks build together, so that none ever holds the whole.
#pragma once

#include <cstdint>
#include <vector>

#include "mpi/communicator.hpp"
#include "partition/partition.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

class ShareSurveyor;

struct ShareOptions {
  std::vector<Partitioner> candidates{Partitioner::bisection, Partitioner::curve,
                                      Partitioner::metis};
  /// Phyxels along Hilbert's curve that stay together, counted from the start of each part: a GPU's
  /// tile. 0: none need to.
  int tile = 0;
  /// Who searches, if no lists shall be made on the host; null: the host.
  const ShareSurveyor* surveyor = nullptr;
  /// What is partitioned are single phyxels, if there are no more than these, or else groups along
  /// the curve.
  Index most_groups = 100'000;
  /// Of more phyxels than these, only some tell whom they share edges with, for all.
  Index most_samples = 1'000'000;
};

struct BuiltShare {
  Model model;  ///< Its `share` is connected.
  Partitioner partitioner = Partitioner::metis;
  PartitionQuality quality;
  std::vector<Surface> surfaces;  ///< Of the whole bodies, in place.
  /// Of the whole model, as the functions of these names tell them.
  std::uint64_t digest = 0, digest_before_4 = 0;
};

/// This rank's share of `build_model(scene)`, to the last bit what `share_of` would take out of the
/// whole (but for moments of ghosts that only carry surfels, which no step reads). Lattices are
/// made piece by piece, other bodies are made or read by every rank, and cut; surfaces are held
/// whole. Phyxels then go where Hilbert's curve says, are partitioned as graph of groups, and go to
/// their owners, which ask the others for what is around. Closing vectors are found by all ranks
/// together, from lists on the host. Collective.
/// @throws AgreedError on all ranks for what `build_model` refuses
BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const ShareOptions& options);
/// The same from clouds in place, one for each body, which every rank has whole.
BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const std::vector<Cloud>& clouds, const ShareOptions& options);

}  // namespace phyxel
