/// Surfels in blocks that find all they need of the phyxels in shared memory. Plain host code
/// without CUDA.
#pragma once

#include <cstdint>
#include <vector>

#include "setup/tiling.hpp"

namespace phyxel::cuda {

inline constexpr int surfel_block = 256;  ///< Surfels a block.
inline constexpr int list_lanes = 4;      ///< Threads that share a carrier's list.

/// Surfels near each other, their carriers and the carriers' neighbours.
struct SurfelBlock {
  int first_surfel = 0, surfels = 0;
  /// Places in `SurfelPlan::place`: the carriers, then whom else they have as neighbours.
  Offset first_slot = 0;
  int slots = 0, carriers = 0;
  /// Neighbour e of carrier c: neighbours[first_neighbour + c * longest + e], a slot; filled up
  /// with the carrier's own. A multiple of `list_lanes`.
  Offset first_neighbour = 0;
  int longest = 0;
  /// Carrier k of surfel s, and how much it counts: first_carrier + k * surfel_block + s.
  Offset first_carrier = 0;
  int most_carriers = 0;
  Index tile = 0;  ///< One of its body's.
  Vec3d centre;    ///< Of its surfels at rest [m].
};

struct SurfelPlan {
  std::vector<Index> order;  ///< Which surfel is the k-th.
  std::vector<SurfelBlock> blocks;
  std::vector<Index> place;
  std::vector<std::uint16_t> neighbours, carriers;
  std::vector<double> weights;  ///< Zero: fewer carriers. See `carrier_weights`.
  int most_slots = 0, most_block_carriers = 0;
};

/// @param tiling with its lists on the host
SurfelPlan make_surfel_plan(const Model& model, const Tiling& tiling);

}  // namespace phyxel::cuda
