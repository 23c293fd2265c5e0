/// The plan of resident bodies, which stay in shared memory for many steps: tiles are cut into
/// slices of one block each. Host code without CUDA.
#pragma once

#include <array>
#include <cstdint>

#include "setup/tiling.hpp"

namespace phyxel::cuda {

inline constexpr int slice_size = 64;  ///< Phyxels per block.
inline constexpr int slice_warps = slice_size / warp_size;
inline constexpr int pair_group = 4;                ///< Entries that a lane processes at once.
inline constexpr std::uint16_t far_entry = 0x8000;  ///< Added to an entry without a neighbour.
inline constexpr std::uint32_t nobody = ~std::uint32_t{0};

/// The phyxels of one block.
struct Slice {
  Index first_place = 0;  ///< First tile slot of its `slice_size` phyxels.
  int slots = 0;          ///< Slots of its image, a multiple of 8.
  int first_slot = 0;     ///< First of its slots in `ResidentPlan::place`.
  int halo = 0;           ///< Slots of other slices' phyxels.
  Index body = 0;         ///< Index of the body, a group of slices that reach each other.
  int rank = 0;           ///< Index among the slices of its body.
  /// Slots of other slices for phyxel p: destinations[first_destination + k * slice_size + p].
  int first_destination = 0, destinations = 0;
  /// Entries of a lane for one pass: the longest list of the slice, padded to whole groups, and
  /// that of each warp.
  struct Rows {
    int first_entry = 0, longest = 0;
    std::array<int, slice_warps> length{};
  };
  std::array<Rows, 2> rows;
};

struct ResidentPlan {
  std::vector<Slice> slices;
  std::vector<Index> place;  ///< Tile slot of each slot of each slice, own ones first; -1 if empty.
  /// Entry e of phyxel p of a slice, as a slot of its image, or its own slot if there is no
  /// neighbour: entries[rows.first_entry + e * slice_size + p].
  std::vector<std::uint16_t> entries;
  /// Rank of a slice << 16 | slot; `nobody` marks an unused entry.
  std::vector<std::uint32_t> destinations;
  int most_slots = 0, most_destinations = 0;
  Index bodies = 0;
  int most_slices = 0;           ///< Most slices of a body.
  std::array<int, 2> longest{};  ///< Most entries of a lane over all slices, for each pass.
};

/// Makes the plan. Slots keep their columns of shared memory, so that lists in the order of their
/// tile stay free of bank conflicts. If one list serves both passes, the second rows equal the
/// first.
ResidentPlan make_resident_plan(const Tiling& tiling);

}  // namespace phyxel::cuda
