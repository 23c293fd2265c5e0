/// The start vector of the search for the largest eigenfrequency, the same on every device.
#pragma once

#include <cstdint>

#include "phyxel/types.hpp"

namespace phyxel {

/// Three pseudo-random numbers between -0.5 and 0.5 for a phyxel. Source: S. Vigna's SplitMix64.
PHYXEL_HD Vec3d start_component(Index phyxel) {
  double values[3];
  for (int e = 0; e < 3; ++e) {
    std::uint64_t z = (3 * static_cast<std::uint64_t>(phyxel) + static_cast<std::uint64_t>(e) + 1) *
                      0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    values[e] = static_cast<double>((z ^ z >> 31) >> 11) * 0x1p-53 - 0.5;
  }
  return {values[0], values[1], values[2]};
}

/// A vector without its components along prescribed axes. @param axes `Axes::bits`
template <class Real>
PHYXEL_HD Vec3<Real> free_components(Vec3<Real> v, int axes) {
  return {axes & 1 ? Real(0) : v.x, axes & 2 ? Real(0) : v.y, axes & 4 ? Real(0) : v.z};
}

}  // namespace phyxel
