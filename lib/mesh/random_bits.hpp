/// Counter-based random numbers: functions of an index and a seed, without a state.
#pragma once

#include <cstdint>

#include "phyxel/types.hpp"

namespace phyxel {

/// A 64-bit hash of `v`. Source: Steele, Lea, Flood 2014 (SplitMix64).
PHYXEL_HD std::uint64_t mix_bits(std::uint64_t v) {
  v += 0x9e3779b97f4a7c15u;
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}

/// A number uniform in (0, 1), made of the low 21 bits.
PHYXEL_HD double unit_fraction(std::uint64_t bits) {
  return (static_cast<double>(bits & 0x1fffff) + 0.5) / 2097152.0;
}

}  // namespace phyxel
