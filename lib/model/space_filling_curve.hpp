/// Order along Hilbert's curve: places near each other on the curve are near each other in space.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Bits of each coordinate in a key.
inline constexpr int hilbert_bits = 21;

/// Two zeros between any two bits of the lowest 21.
PHYXEL_HD std::uint64_t spread_bits(std::uint64_t bits) {
  bits = (bits | bits << 32) & 0x001f00000000ffff;
  bits = (bits | bits << 16) & 0x001f0000ff0000ff;
  bits = (bits | bits << 8) & 0x100f00f00f00f00f;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
  bits = (bits | bits << 2) & 0x1249249249249249;
  return bits;
}

/// Position along the curve of a cell of a 2²¹ × 2²¹ × 2²¹ grid. Source: J. Skilling, Programming
/// the Hilbert curve, AIP Conf. Proc. 707 (2004) 381, coordinates to transpose to key.
PHYXEL_HD std::uint64_t hilbert_key(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  std::uint32_t axis[3] = {x, y, z};
  for (int b = hilbert_bits - 1; b > 0; --b) {
    const std::uint32_t below = (std::uint32_t{1} << b) - 1;
    for (int a = 0; a < 3; ++a) {  // without branches, which nobody could foretell
      const std::uint32_t inverted = 0 - (axis[a] >> b & 1);
      const std::uint32_t swapped = (axis[0] ^ axis[a]) & below & ~inverted;
      axis[a] ^= swapped;
      axis[0] ^= swapped | (below & inverted);
    }
  }
  axis[1] ^= axis[0];
  axis[2] ^= axis[1];
  std::uint32_t flip = axis[2] >> 1;  // of each bit: the parity of those above
  for (int shift = 1; shift < hilbert_bits; shift *= 2) flip ^= flip >> shift;
  return spread_bits(axis[0] ^ flip) << 2 | spread_bits(axis[1] ^ flip) << 1 |
         spread_bits(axis[2] ^ flip);
}

/// The grid over a cloud's box.
struct HilbertFrame {
  Vec3d low;         ///< A corner of the box [m].
  double scale = 0;  ///< Cells a metre.

  static HilbertFrame around(Vec3d low, Vec3d high) {
    const double extent = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
    return {low, extent > 0 ? cells / extent : 0};
  }
  PHYXEL_HD std::uint64_t key_of(Vec3d x) const {
    return hilbert_key(cell(x.x, low.x), cell(x.y, low.y), cell(x.z, low.z));
  }

 private:
  static constexpr double cells = (1 << hilbert_bits) - 1;
  PHYXEL_HD std::uint32_t cell(double x, double from) const {
    const double at = (x - from) * scale;
    return static_cast<std::uint32_t>(at < 0 ? 0 : at > cells ? cells : at);
  }
};

/// Points [begin, end) along the curve over their box; those of one cell in the order of their
/// indices.
std::vector<Index> curve_order(std::span<const Vec3d> position, Index begin, Index end);

/// Brings phyxels that follow each other along the curve into the order of their places in a GPU's
/// tile: long lists first, so that the lanes of a warp have about equally many neighbours.
/// @param length length(i): of the list of phyxel i
template <class Length>
void order_in_tile(std::span<Index> phyxels, Length&& length) {
  std::stable_sort(phyxels.begin(), phyxels.end(),
                   [&](Index a, Index b) { return length(a) > length(b); });
}

}  // namespace phyxel
