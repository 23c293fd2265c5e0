/// Surfels in blocks whose carriers are few, and the tiles that have carriers. Plain host code
/// without CUDA.
#pragma once

#include <cstdint>
#include <vector>

#include "setup/tiling.hpp"

namespace phyxel::cuda {

inline constexpr int surfel_block = 256;  ///< Surfels a block, at most.
inline constexpr int block_slots =
    512;  ///< Phyxels that carry them, at most, unless one surfel has more.
inline constexpr int carrier_group = 4;  ///< Carriers that a surfel takes at once.

/// Surfels near each other.
struct SurfelBlock {
  int first_surfel = 0, surfels = 0;
  Offset first_slot = 0;  ///< In `SurfelPlan::place`.
  int slots = 0;          ///< Phyxels that carry any of its surfels.
  /// Carrier k of surfel s: first_carrier + k * surfel_block + s; filled up to whole groups.
  Offset first_carrier = 0;
  int carriers = 0;  ///< Of a surfel, at most.
  Index tile = 0;    ///< One of its body's (not more: of its carriers').
  Vec3d centre;      ///< Of its surfels at rest [m].
};

/// A carrier's slot, and how much it counts for the surfel; zero: filled up.
struct Carrier {
  double weight = 0;
  int slot = 0;
};

struct SurfelPlan {
  std::vector<Index> order;  ///< Which surfel is the k-th.
  std::vector<SurfelBlock> blocks;
  std::vector<Index> place;  ///< Of each slot.
  std::vector<Carrier> carriers;
  std::vector<Index> tiles;  ///< That have carriers, ascending.
  int most_slots = 0;
};

/// Of a share, blocks are those of the whole model, surfel by surfel and carrier by carrier.
/// @param place of each phyxel, as in `Tiling`
SurfelPlan make_surfel_plan(const Model& model, const std::vector<Index>& place);

}  // namespace phyxel::cuda
