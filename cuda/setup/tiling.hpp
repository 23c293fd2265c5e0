/// Layout of a model for a GPU: phyxels in the order of a space-filling curve, cut into tiles whose
/// points fit shared memory, and neighbour lists of 16-bit slots in that memory.
///
/// A place is an index into the tiles: tile * tile_size + tile slot. A slot is an index into the
/// shared memory of a tile's block.
///
/// A warp takes 32 neighbouring phyxels and traverses their lists in lockstep, one lane for each
/// phyxel. Shared memory serves eight lanes at a time, 16 bytes each, without a bank conflict if
/// their slots differ modulo 8 or are equal; the entries of lists are ordered accordingly (see
/// wait_free.hpp). Sums run in the same order in every kernel, so that results do not depend on how
/// a step is launched.
///
/// An idle lane reads a null point: one beyond every support, at the price of a comparison in each
/// weight. Its own phyxel, whose weight is zero, would cause bank conflicts.
///
/// Host code without CUDA.
#pragma once

#include <cstdint>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel::cuda {

inline constexpr int tile_size = 256;  ///< Number of tile slots.
inline constexpr int warp_size = 32;
inline constexpr int far_slots = 8;  ///< Number of null points: one for each bank of 16 bytes.
inline constexpr int chunk = 8;      ///< Number of entries that a lane loads at once.
/// Largest number of slots: a slot's offset in bytes, 16 × slot, must fit 16 bits.
inline constexpr int most_slots = 4096;
inline constexpr int most_halo = most_slots - tile_size - far_slots;
/// Throws the InputError for a tile whose halo has too many points.
[[noreturn]] void refuse_halo(int points);

/// Neighbour lists, tile by tile. The slots of a tile are its own phyxels, `far_slots` null points
/// and its halo, in this order.
struct TileLists {
  /// Places of other tiles that a tile needs, ascending, padded with -1, shape [tiles,
  /// halo_stride].
  std::vector<Index> halo;
  int halo_stride = 0;
  /// The lists of a warp: their first chunk, and the number of entries of a lane.
  struct Row {
    std::int32_t chunk = 0, length = 0;
  };
  std::vector<Row> rows;  ///< Shape [places / warp_size].
  /// 16 × slot; entry e of lane l of a warp is [(row.chunk + e / chunk) * warp_size + l][e %
  /// chunk].
  std::vector<std::uint16_t> entries;

  int slots() const { return tile_size + far_slots + halo_stride; }
  /// Number of entries in the list of a place, including null points.
  int length_of(Index place) const { return rows[place / warp_size].length; }
  /// The slot of entry e of a place.
  int slot_of(Index of, int e) const {
    const std::size_t lane =
        static_cast<std::size_t>(rows[of / warp_size].chunk + e / chunk) * warp_size +
        of % warp_size;
    return entries[lane * chunk + e % chunk] / 16;
  }
  /// The place in a slot of a tile; -1 for a null point.
  Index place_in(Index tile, int slot) const {
    if (slot < tile_size) return tile * tile_size + slot;
    if (slot < tile_size + far_slots) return -1;
    return halo[static_cast<std::size_t>(tile) * halo_stride + slot - tile_size - far_slots];
  }
  std::size_t bytes() const {
    return halo.size() * sizeof(Index) + rows.size() * sizeof(Row) +
           entries.size() * sizeof(std::uint16_t);
  }
};

struct Tiling {
  std::vector<Index> phyxel;  ///< Phyxel at each place, or -1, shape [tiles · tile_size].
  std::vector<Index> place;   ///< Place of each phyxel, shape [n].
  std::vector<Index> part;    ///< Part of each tile, shape [tiles].
  /// Number of tiles with lists, which come first, before tiles of ghosts; and the number of those
  /// that exchange values with other ranks, which come first among them.
  Index own_tiles = 0, boundary_tiles = 0;
  TileLists neighbours;  ///< For the first pass.
  TileLists inverse;     ///< For the second pass; empty if the neighbours serve both.

  Index places() const { return static_cast<Index>(phyxel.size()); }
  Index tiles() const { return static_cast<Index>(part.size()); }
  const TileLists& second() const { return inverse.rows.empty() ? neighbours : inverse; }
};

/// Makes the tiles and lists of a model on the host: what a device makes (`make_device_tiling`) is
/// compared with them. The own tiles of a share are tiles of the whole model,
/// with the same entries in the same order, so that sums round alike; a partition must not cut them
/// (see `curve_groups`). Ghosts follow, in tiles of their own.
/// @throws InputError if a tile reaches more points than 16-bit slots can address
Tiling make_tiling(const Model& model);

/// Assigns the places of a share: its tiles of the whole model, boundary tiles first, then ghosts,
/// body by body. Sets all members of the tiling except its lists.
/// @param reaches_ghosts nonzero for phyxels that need a ghost in either pass, shape [n]
void place_share(const Model& model, const std::vector<char>& reaches_ghosts, Tiling& tiling);

/// The global id of the phyxel at each place; -1 at empty places.
/// @param phyxel the phyxel at each place, or -1
std::vector<Index> numbers_at(const Model& model, const std::vector<Index>& phyxel);

}  // namespace phyxel::cuda
