/// The plan of surfel advection: blocks of surfels with few carriers, and the tiles that have
/// carriers. Host code without CUDA.
#pragma once

#include <cstdint>
#include <vector>

#include "setup/tiling.hpp"
#include "solver/crack_sides.hpp"

namespace phyxel::cuda {

inline constexpr int surfel_block = 256;  ///< Most surfels of a block.
inline constexpr int block_slots = 512;   ///< Most carriers of a block, unless one surfel has more.
inline constexpr int carrier_group = 4;   ///< Carriers that a surfel processes at once.

/// Surfels close to each other, advected by one block.
struct SurfelBlock {
  int first_surfel = 0, surfels = 0;
  Offset first_slot = 0;  ///< First of its slots in `SurfelPlan::place`.
  int slots = 0;          ///< Number of its carriers.
  /// Carrier k of surfel s has the index first_carrier + k * surfel_block + s; rows are padded to
  /// whole groups.
  Offset first_carrier = 0;
  int carriers = 0;  ///< Most carriers of a surfel.
  Index tile = 0;    ///< A tile of its body.
  Vec3d centre;      ///< Centre of its surfels at rest [m].
};

/// A carrier's slot and weight; the weight is zero for padding.
struct Carrier {
  double weight = 0;
  int slot = 0;
};

struct SurfelPlan {
  std::vector<Index> order;  ///< Surfels in the order of the plan.
  std::vector<SurfelBlock> blocks;
  std::vector<Index> place;  ///< Tile slot of each slot.
  std::vector<Carrier> carriers;
  std::vector<Index> tiles;  ///< Tiles with carriers, ascending.
  int most_slots = 0;
};

/// Makes the plan. On a share, blocks equal those of the whole model, in surfels and carriers.
/// @param place tile slot of each phyxel, as in `Tiling`. @param sides carriers on the other side
/// of a crack have weight zero; nothing else depends on them
SurfelPlan make_surfel_plan(const Model& model, const std::vector<Index>& place,
                            const CrackSides& sides = {});

}  // namespace phyxel::cuda
