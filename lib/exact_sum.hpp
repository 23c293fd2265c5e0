/// Sums without rounding, whose bits do not depend on the order of the terms, nor on the number of
/// threads and ranks. Source: U. Kulisch's long accumulator, with limbs of 32 bits in 64-bit words,
/// so that a billion terms can be added before carries are propagated.
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
  // Bit 0 of limb 0 is 2^lowest; doubles range from 2^-1074 to below 2^1024.
  static constexpr int lowest = -1074, limb_bits = 32;
  static constexpr int limbs = (1024 - lowest) / limb_bits + 3;  // two more for carries

 public:
  /// Number of words that ranks and GPU threads may add element-wise: up to 2^30 terms before
  /// carries are propagated.
  static constexpr int words = limbs + 1;

  /// Calls add(word, number) for the contributions of a term to the words.
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
    const int at = exponent > 0 ? exponent - 1 : 0;  // position of the lowest bit above 2^-1074
    const int limb = at / limb_bits, shift = at % limb_bits;
    const std::uint64_t low = mantissa
                              << shift;  // 53 + 31 bits; the upper bits are added separately
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

  /// Propagates carries and returns the words, which may then be added over ranks.
  std::span<std::int64_t> ready() {
    carry();
    return words_;
  }

  /// The double nearest to the sum; NaN if a term was not finite.
  double value() const {
    if (words_[limbs] != 0) return std::numeric_limits<double>::quiet_NaN();
    ExactSum whole = *this;
    whole.carry();
    // After propagation, limbs are in [0, 2^32), except for the highest one, which has the sign.
    const bool negative = whole.words_[limbs - 1] < 0;
    if (negative) {
      for (int k = 0; k < limbs; ++k) whole.words_[k] = -whole.words_[k];
      whole.carry();
    }
    int top = limbs - 1;
    while (top >= 0 && whole.words_[top] == 0) --top;
    if (top < 0) return 0;
    // The leading 64 bits, with a sticky last bit for the bits below, so that the conversion to
    // double rounds correctly.
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
      words_[k + 1] += words_[k] >> limb_bits;  // rounds down, also for negative words
      words_[k] &= 0xFFFF'FFFF;
    }
    terms_ = 0;
  }

  std::array<std::int64_t, words> words_{};  // the last word counts terms that are not finite
  std::int64_t terms_ = 0;  // number of terms since the last propagation of carries
};

/// An exact sum of vectors.
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
