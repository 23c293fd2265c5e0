/// Grids of voxels with a sample point each. Shared by the samplers on the CPU and on the GPU.
#pragma once

#include <cstdint>

#include "mesh/random_bits.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The random bits of a voxel's coordinate.
PHYXEL_HD std::uint64_t bits_of(std::int64_t coordinate) {
  return mix_bits(static_cast<std::uint64_t>(coordinate));
}
/// The random bits of a row of voxels along z. @param x,y bits of its coordinates
PHYXEL_HD std::uint64_t bits_of_row(std::uint64_t seed, std::uint64_t x, std::uint64_t y) {
  return mix_bits(mix_bits(seed ^ x) ^ y);
}
/// The position of a sample point in its voxel, in sides of the voxel. @param row bits of the
/// voxel's row. @param z bits of its coordinate
PHYXEL_HD Vec3d random_in(std::uint64_t row, std::uint64_t z) {
  const std::uint64_t bits = mix_bits(row ^ z);
  return {unit_fraction(bits), unit_fraction(bits >> 21), unit_fraction(bits >> 42)};
}

/// A voxel, or the lower corner of some, in sides of a voxel.
struct Voxel {
  std::int64_t x = 0, y = 0, z = 0;
};

/// A grid of voxels, each with a sample point: at random, or, if the grid is turned, in the middle.
struct SampleGrid {
  double voxel = 0;  ///< Side of the voxels [m].
  Vec3d origin;      ///< The corner of voxel (0, 0, 0) [m].
  Mat3d turn;        ///< Turn of the grid; unused if points are at random.
  std::uint64_t seed = 1;
  bool at_random = true;

  /// A place given in sides of a voxel [m].
  PHYXEL_HD Vec3d place(double x, double y, double z) const {
    const Vec3d from_origin = voxel * Vec3d{x, y, z};
    return origin + (at_random ? from_origin : turn * from_origin);
  }
  /// The middle of a cube of `side` voxels a side [m].
  PHYXEL_HD Vec3d middle(Voxel corner, std::int64_t side) const {
    const double half = 0.5 * static_cast<double>(side);
    return place(static_cast<double>(corner.x) + half, static_cast<double>(corner.y) + half,
                 static_cast<double>(corner.z) + half);
  }
  /// The place of a voxel's sample point in the voxel, in sides of the voxel.
  PHYXEL_HD Vec3d within(Voxel v) const {
    if (!at_random) return {0.5, 0.5, 0.5};
    return random_in(bits_of_row(seed, bits_of(v.x), bits_of(v.y)), bits_of(v.z));
  }
  /// A point of a voxel, from a block's centre [m]. @param within in sides of the voxel
  PHYXEL_HD Vec3<float> offset(Voxel v, Vec3d within, Vec3d centre) const {
    return to<float>(place(static_cast<double>(v.x) + within.x, static_cast<double>(v.y) + within.y,
                           static_cast<double>(v.z) + within.z) -
                     centre);
  }
};

/// Voxels along a side of a block, and of a region of 2 x 2 x 2 blocks.
inline constexpr std::int64_t block_side = 4, region_side = 2 * block_side;
/// Voxels of a block, and of a region.
inline constexpr int block_voxels = 64, region_voxels = 512;

/// A region of 8 x 8 x 8 voxels, some of whose blocks are wanted.
struct SampleRegion {
  Voxel corner;             ///< Multiples of `region_side`.
  std::uint8_t blocks = 0;  ///< Bit k is set if block k is wanted; x is the lowest bit of k.
  bool inside = false;      ///< True if the wanted blocks lie inside the surface as wholes.

  /// The corner of a block. @param k 0 to 7
  PHYXEL_HD Voxel block(int k) const {
    return {corner.x + (k & 1) * block_side, corner.y + (k >> 1 & 1) * block_side,
            corner.z + (k >> 2) * block_side};
  }
};

/// The m-th voxel of a block, in the order in which an octree comes to it.
PHYXEL_HD Voxel voxel_of(Voxel block, int m) {
  const int low = m & 7, high = m >> 3;
  return {block.x + (low & 1) + 2 * (high & 1), block.y + (low >> 1 & 1) + 2 * (high >> 1 & 1),
          block.z + (low >> 2) + 2 * (high >> 2)};
}

/// The place of a point given from a block's centre [m].
PHYXEL_HD Vec3d at_offset(Vec3d centre, Vec3<float> offset) {
  return centre + Vec3d{offset.x, offset.y, offset.z};
}

/// The radius of a ball around the middle of a cube that contains its sample points, which are
/// rounded to float [m]. @param side in voxels
PHYXEL_HD double radius_of_samples(double voxel, std::int64_t side) {
  using std::sqrt;
  return 0.5 * sqrt(3.0) * (static_cast<double>(side) + 1e-3) * voxel;
}

}  // namespace phyxel
