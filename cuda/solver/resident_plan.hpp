/// Who keeps what when all bodies stay in shared memory for many steps: tiles cut into slices, one
/// block each. Plain host code without CUDA.
#pragma once

#include <array>
#include <cstdint>

#include "setup/tiling.hpp"

namespace phyxel::cuda {

inline constexpr int slice_size = 64;  ///< Phyxels a block.
inline constexpr int slice_warps = slice_size / warp_size;
inline constexpr int pair_group = 4;                ///< Entries that a lane takes at once.
inline constexpr std::uint16_t far_entry = 0x8000;  ///< Added to an entry without a neighbour.
inline constexpr std::uint32_t nobody = ~std::uint32_t{0};

/// The share of one block.
struct Slice {
  Index first_place = 0;  ///< Of its `slice_size` phyxels.
  int slots = 0;          ///< Of its image, a multiple of 8.
  int first_slot = 0;     ///< Where its slots begin in `ResidentPlan::place`.
  int halo = 0;           ///< Slots of other slices' phyxels.
  Index body = 0;         ///< Slices that reach each other make a body, counted from 0.
  int rank = 0;           ///< Among the slices of its body.
  /// Who else has a slot for phyxel p: destinations[first_destination + k * slice_size + p].
  int first_destination = 0, destinations = 0;
  /// Entries of a lane, for either pass: the longest of the slice, filled up to whole groups, and
  /// of each warp.
  struct Rows {
    int first_entry = 0, longest = 0;
    std::array<int, slice_warps> length{};
  };
  std::array<Rows, 2> rows;
};

struct ResidentPlan {
  std::vector<Slice> slices;
  std::vector<Index> place;  ///< Of each slot of each slice; -1: empty. Its own come first.
  /// Entry e of phyxel p of a slice, as a slot of its image, its own where there is no neighbour:
  /// [rows.first_entry + e * slice_size + p].
  std::vector<std::uint16_t> entries;
  /// Rank of a slice << 16 | its slot; `nobody`: no more.
  std::vector<std::uint32_t> destinations;
  int most_slots = 0, most_destinations = 0;
  Index bodies = 0;
  int most_slices = 0;           ///< Of a body.
  std::array<int, 2> longest{};  ///< Entries of a lane over all slices, for either pass.
};

/// Slots keep their column of shared memory, so that lists in the order of their tile stay free of
/// waiting. With lists that serve both passes the second rows equal the first.
ResidentPlan make_resident_plan(const Tiling& tiling);

}  // namespace phyxel::cuda
