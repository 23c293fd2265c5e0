/// How a model is laid out for a GPU: phyxels in the order of a space-filling curve, cut into tiles
/// whose points fit shared memory, and neighbour lists in 16-bit slots of that memory.
///
/// A warp takes 32 neighbouring phyxels and walks their lists in step, one lane a phyxel. Shared
/// memory answers eight lanes at a time, 16 bytes each, at once if their slots differ modulo 8 or
/// are the same; so the entries of a list are put into an order in which they do (see
/// wait_free.hpp). That order is also the one in which sums run, whatever kernel walks the list:
/// results do not depend on the way of launching.
///
/// A lane with nothing to do takes a far point, which costs a comparison in every weight. Its own
/// phyxel, with a share of exactly zero, would do without, but too often meets others in a column.
///
/// Plain host code without CUDA.
#pragma once

#include <cstdint>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel::cuda {

inline constexpr int tile_size = 256;  ///< Places a tile.
inline constexpr int warp_size = 32;
inline constexpr int far_slots = 8;  ///< Slots of points beyond every support, for filling up.
inline constexpr int chunk = 8;      ///< Entries that a lane loads at once.
/// A slot's number times its 16 bytes must fit 16 bits.
inline constexpr int most_slots = 4096;
inline constexpr int most_halo = most_slots - tile_size - far_slots;
/// @throws InputError: a tile has that many neighbours outside.
[[noreturn]] void refuse_halo(int points);

/// Lists of neighbours, tile by tile. Slots of a tile: its own places in order, `far_slots`
/// far points, then its halo.
struct TileLists {
  /// Places of other tiles that a tile needs, ascending, filled up with -1, shape [tiles,
  /// halo_stride].
  std::vector<Index> halo;
  int halo_stride = 0;
  /// Of each warp: where its entries begin, in chunks, and how many entries a lane has.
  struct Row {
    std::int32_t chunk = 0, length = 0;
  };
  std::vector<Row> rows;  ///< Shape [places / warp_size].
  /// 16 × slot; entry e of lane l of a warp is [(row.chunk + e / chunk) * warp_size + l][e %
  /// chunk].
  std::vector<std::uint16_t> entries;

  int slots() const { return tile_size + far_slots + halo_stride; }
  /// Entries of the list of a place, far ones included.
  int length_of(Index place) const { return rows[place / warp_size].length; }
  /// The slot that entry e of a place names.
  int slot_of(Index of, int e) const {
    const std::size_t lane =
        static_cast<std::size_t>(rows[of / warp_size].chunk + e / chunk) * warp_size +
        of % warp_size;
    return entries[lane * chunk + e % chunk] / 16;
  }
  /// The place in a slot of a tile; -1: a far point.
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
  std::vector<Index> phyxel;  ///< Which phyxel is at a place; -1: none, shape [tiles · tile_size].
  std::vector<Index> place;   ///< Where a phyxel is, shape [n].
  std::vector<Index> part;    ///< Body of a tile, shape [tiles].
  /// The first tiles have lists; the rest are a share's ghosts. Of those with lists, the first ones
  /// name ghosts, or are ghosts elsewhere.
  Index own_tiles = 0, boundary_tiles = 0;
  TileLists neighbours;  ///< For the first pass.
  TileLists inverse;     ///< For the second pass; empty if the neighbours serve both.

  Index places() const { return static_cast<Index>(phyxel.size()); }
  Index tiles() const { return static_cast<Index>(part.size()); }
  const TileLists& second() const { return inverse.rows.empty() ? neighbours : inverse; }
};

/// Of a share, own tiles are those of the whole model, phyxel by phyxel and entry by entry, so that
/// sums run alike; they must be whole (see `curve_groups`). Ghosts follow, in tiles of their own.
/// @throws InputError if a tile reaches more points than 16-bit slots can name.
Tiling make_tiling(const Model& model);

/// Places of a share: the tiles of the whole, as far as they are here, those first that reach
/// ghosts or are ghosts elsewhere; then ghosts, body by body. Sets all of a tiling but its lists.
/// @param reaches_ghosts whether each phyxel needs a ghost in either pass, shape [n]
void place_share(const Model& model, const std::vector<char>& reaches_ghosts, Tiling& tiling);

/// Of each place, the number of its phyxel in the whole model; -1: nobody. @param phyxel of each
///   place
std::vector<Index> numbers_at(const Model& model, const std::vector<Index>& phyxel);

}  // namespace phyxel::cuda
