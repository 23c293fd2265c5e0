/// Sums without rounding: the same bits in whatever order, and on however many threads and ranks,
/// the terms are added. Source: U. Kulisch's long accumulator; limbs of 32 bits in 64-bit words, so
/// that a billion terms are added before a carry has to move.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

#include "phyxel/types.hpp"

namespace phyxel {

class ExactSum {
  // Bit 0 of limb 0 stands for 2^lowest; a double reaches from 2^-1074 to below 2^1024.
  static constexpr int lowest = -1074, limb_bits = 32;
  static constexpr int limbs = (1024 - lowest) / limb_bits + 3;  // two more for the carry

 public:
  /// Words that ranks, and threads of a GPU, may add element by element: up to 2^30 terms before
  /// a carry has to move.
  static constexpr int words = limbs + 1;

  /// What a term adds to `words`, as calls add(word, number).
  template <class Add>
  PHYXEL_HD static void split(double value, Add&& add) {
    std::uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    const int exponent = static_cast<int>(bits >> 52 & 0x7FF);
    std::uint64_t mantissa = bits & ((std::uint64_t{1} << 52) - 1);
    if (exponent == 0x7FF) {
      add(limbs, 1);
      return;
    }
    if (exponent > 0) mantissa |= std::uint64_t{1} << 52;
    const int at = exponent > 0 ? exponent - 1 : 0;  // of the lowest bit, above 2^-1074
    const int limb = at / limb_bits, shift = at % limb_bits;
    const std::uint64_t low = mantissa << shift;  // 53 + 31 bits: the top ones are added apart
    const std::uint64_t top = shift ? mantissa >> (64 - shift) : 0;
    const std::int64_t sign = bits >> 63 ? -1 : 1;
    add(limb, sign * static_cast<std::int64_t>(low & 0xFFFF'FFFF));
    add(limb + 1, sign * static_cast<std::int64_t>(low >> 32));
    add(limb + 2, sign * static_cast<std::int64_t>(top));
  }

  void add(double value) {
    split(value, [&](int word, std::int64_t number) { words_[word] += number; });
    if (++terms_ == most_terms) carry();
  }
  void add(const ExactSum& other) {
    ExactSum from = other;
    from.carry();
    carry();
    for (int k = 0; k < words; ++k) words_[k] += from.words_[k];
    carry();
  }

  /// For sums over ranks: after `ready`, the words of all ranks may be added.
  std::span<std::int64_t> ready() {
    carry();
    return words_;
  }

  /// The double nearest to the sum; NaN if a term was not finite.
  double value() const {
    if (words_[limbs] != 0) return std::numeric_limits<double>::quiet_NaN();
    ExactSum whole = *this;
    whole.carry();
    // Carries leave limbs of [0, 2^32) below one that has the sign.
    const bool negative = whole.words_[limbs - 1] < 0;
    if (negative) {
      for (int k = 0; k < limbs; ++k) whole.words_[k] = -whole.words_[k];
      whole.carry();
    }
    int top = limbs - 1;
    while (top >= 0 && whole.words_[top] == 0) --top;
    if (top < 0) return 0;
    // The leading 64 bits; whether any is set below them goes into the last, so that the one
    // rounding to a double is right.
    const auto limb = [&](int k) {
      return k < 0 ? 0 : static_cast<std::uint64_t>(whole.words_[k]);
    };
    const std::uint64_t below = limb(top - 1) << 32 | limb(top - 2);
    const int zeros = std::countl_zero(static_cast<std::uint32_t>(limb(top)));
    std::uint64_t leading = limb(top) << (32 + zeros) | below >> (32 - zeros);
    bool more = below << (32 + zeros) != 0;
    for (int k = top - 3; k >= 0; --k) more = more || whole.words_[k] != 0;
    leading |= static_cast<std::uint64_t>(more);
    const double magnitude =
        std::ldexp(static_cast<double>(leading), lowest + (top - 2) * limb_bits + 32 - zeros);
    return negative ? -magnitude : magnitude;
  }

 private:
  static constexpr std::int64_t most_terms = std::int64_t{1} << 30;

  void carry() {
    for (int k = 0; k + 1 < limbs; ++k) {
      words_[k + 1] += words_[k] >> limb_bits;  // rounds down, also of negative ones
      words_[k] &= 0xFFFF'FFFF;
    }
    terms_ = 0;
  }

  std::array<std::int64_t, words> words_{};  // the last: terms that were not finite
  std::int64_t terms_ = 0;                   // since the last carry
};

/// Three of them.
struct ExactVector {
  ExactSum x, y, z;
  void add(Vec3d v) {
    x.add(v.x);
    y.add(v.y);
    z.add(v.z);
  }
  void add(const ExactVector& other) {
    x.add(other.x);
    y.add(other.y);
    z.add(other.z);
  }
  Vec3d value() const { return {x.value(), y.value(), z.value()}; }
};

}  // namespace phyxel
