/// The set-up of a model by all ranks together, none of which ever holds the whole.
#pragma once

#include <cstdint>
#include <vector>

#include "model/closure.hpp"
#include "mpi/communicator.hpp"
#include "partition/partition.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

class ShareSurveyor;

struct ShareOptions {
  std::vector<Partitioner> candidates{Partitioner::bisection, Partitioner::curve,
                                      Partitioner::metis};
  /// Number of phyxels along Hilbert's curve that stay on one rank, counted from the start of each
  /// part: the size of a GPU's tile, or 0 without GPUs.
  int tile = 0;
  /// Neighbour search of a device that makes the lists itself; null: the host makes them.
  const ShareSurveyor* surveyor = nullptr;
  /// Largest number of vertices of the graph that is partitioned: single phyxels if there are no
  /// more, else groups along the curve.
  Index most_groups = 100'000;
  /// Above this number of phyxels, the edges of the graph come from a random sample.
  Index most_samples = 1'000'000;
  /// The search of a device for closed gradients; empty: the host's.
  ClosingSearch close;
};

struct BuiltShare {
  Model model;  ///< Its `share` is connected.
  Partitioner partitioner = Partitioner::metis;
  PartitionQuality quality;
  std::vector<Surface> surfaces;  ///< Whole surfaces of the bodies, in place.
  /// `model_digest` and `model_digest_before_4` of the whole model.
  std::uint64_t digest = 0, digest_before_4 = 0;
};

/// Builds this rank's share of `build_model(scene)`. Its bits are those that `share_of` takes out
/// of the whole model, but for moments of ghosts that only carry surfels, which no step reads.
/// Lattices are made piece by piece. Any other body is made or read by one rank, which deals out
/// its phyxels; every rank has whole surfaces. Phyxels are sorted along Hilbert's curve,
/// partitioned as a graph of groups and sent to their owners, which fetch the phyxels around.
/// Collective.
/// @throws AgreedError on all ranks for what `build_model` refuses
BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const ShareOptions& options);
/// Builds this rank's share from clouds in place, one for each body, which every rank has whole.
BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const std::vector<Cloud>& clouds, const ShareOptions& options);

}  // namespace phyxel
