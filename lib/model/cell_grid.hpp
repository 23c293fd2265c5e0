/// The cells of the spatial hash of Teschner et al. 2003 (reference 30 of Farias et al. 2008):
/// which one a place lies in, its name, its bucket. Shared by the searches on the CPU and on the
/// GPU.
#pragma once

#include <cmath>
#include <cstdint>

#include "phyxel/types.hpp"

namespace phyxel {

/// A coordinate counted in cells, cut to what 62 bits hold; 0 for no number. Clouds of models are
/// finite (`check_cloud`), but a cast of anything else would be undefined.
PHYXEL_HD std::int64_t whole_cells(double value) {
  using std::floor;
  constexpr double most = 4611686018427387904.0;  // 2^62
  if (!(value > -most)) return value <= -most ? -(std::int64_t{1} << 62) : 0;
  return value < most ? static_cast<std::int64_t>(floor(value)) : std::int64_t{1} << 62;
}

struct CellGrid {
  struct Cell {
    std::int64_t x, y, z;
  };

  Vec3d low;                     ///< A corner of the cloud [m].
  double inverse_cell_size = 1;  ///< [1/m]
  std::uint64_t table_mask = 0;  ///< Buckets are a power of two; this is one less.

  PHYXEL_HD Cell cell_of(Vec3d p) const {
    return {whole_cells((p.x - low.x) * inverse_cell_size),
            whole_cells((p.y - low.y) * inverse_cell_size),
            whole_cells((p.z - low.z) * inverse_cell_size)};
  }
  /// A cell's name: 21 bits a coordinate. Cells outside the cloud may share the name of one
  /// inside only if they are two million cells away, and then the distance tells.
  PHYXEL_HD static std::uint64_t name(Cell c) {
    constexpr std::uint64_t mask = 0x1fffff;
    return (static_cast<std::uint64_t>(c.x) & mask) |
           (static_cast<std::uint64_t>(c.y) & mask) << 21 |
           (static_cast<std::uint64_t>(c.z) & mask) << 42;
  }
  /// Buckets of cells that are near each other are near each other, too: a block of 4 x 4 x 4 cells
  /// takes 64 buckets in a row, the stretch number (x p1 xor y p2 xor z p3) mod the number of
  /// stretches, with the paper's primes and x, y, z counted in blocks.
  PHYXEL_HD std::uint64_t bucket_of(std::uint64_t cell) const {
    constexpr std::uint64_t block = 0x7ffff;
    const std::uint64_t h = ((cell >> 2 & block) * 73856093u) ^ ((cell >> 23 & block) * 19349663u) ^
                            ((cell >> 44 & block) * 83492791u);
    const std::uint64_t within = (cell & 3) | (cell >> 19 & 12) | (cell >> 38 & 48);
    // A sheet along an axis would use a quarter of the buckets, the same ones in each block.
    return (h << 6 | (within ^ (h >> 20 & 63))) & table_mask;
  }
  /// Rings of cells around `place` beyond which there is no point of a cloud from `low` to `high`.
  PHYXEL_HD int farthest_ring(Vec3d place, Vec3d high) const {
    const Cell c = cell_of(place), a = cell_of(low), b = cell_of(high);
    constexpr std::int64_t int_max = 0x7fffffff;
    std::int64_t most = 0;
    const std::int64_t apart[] = {c.x - a.x, b.x - c.x, c.y - a.y, b.y - c.y, c.z - a.z, b.z - c.z};
    for (const std::int64_t d : apart) {
      if (d > most) most = d;
      if (-d > most) most = -d;
    }
    return static_cast<int>(most < int_max ? most : int_max);
  }
};

/// Rounding may move a point by that many cells: a cloud is at most a million cells wide.
inline constexpr double cell_rounding = 5e-10;

/// How many cells away points nearer than `reach` may be.
PHYXEL_HD int rings_within(double reach, double cell_size) {
  using std::ceil;
  const double rings = ceil(reach * (1 + cell_rounding) / cell_size);
  constexpr double most = 1 << 30;
  if (!(rings < most)) return rings >= most ? 1 << 30 : 0;
  return static_cast<int>(rings);
}

/// The smallest cell that 21 bits a coordinate allow for a cloud that wide, or `wanted`: a little
/// more, so that what is within `wanted` is in the next cell for sure.
PHYXEL_HD double cell_size_for(Vec3d low, Vec3d high, double wanted) {
  const Vec3d extent = high - low;
  double widest = extent.x > extent.y ? extent.x : extent.y;
  widest = extent.z > widest ? extent.z : widest;
  const double least = widest / 1e6, roomy = wanted * (1 + 2 * cell_rounding);
  const double size = roomy > least ? roomy : least;
  return size > 0 ? size : 1;
}

/// Cells that hold some four points each if the cloud fills its box.
inline double roomy_cell_size(Vec3d low, Vec3d high, std::size_t points) {
  const Vec3d extent = high - low;
  const double widest = std::fmax(extent.x, std::fmax(extent.y, extent.z));
  const double floor_width = widest / 100;  // a sheet or thread has no volume
  const double box = std::fmax(extent.x, floor_width) * std::fmax(extent.y, floor_width) *
                     std::fmax(extent.z, floor_width);
  return std::cbrt(4 * box / static_cast<double>(points));
}

}  // namespace phyxel
