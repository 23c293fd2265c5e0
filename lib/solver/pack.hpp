/// SIMD packs: one lane per phyxel, so that the physics templates run W phyxels at a time and the
/// order of every sum stays that of the neighbour list, whatever the width.
#pragma once

#include <cmath>
#include <cstddef>
#include <utility>

#include "phyxel/types.hpp"

namespace phyxel {

#if defined(__AVX512F__)
inline constexpr std::size_t simd_bytes = 64;
#elif defined(__AVX__)
inline constexpr std::size_t simd_bytes = 32;
#else
inline constexpr std::size_t simd_bytes = 16;
#endif

/// W lanes of T with element-wise arithmetic, on the compiler's vector extension.
template <class T, int W>
struct Pack {
  typedef T Lanes __attribute__((vector_size(W * sizeof(T))));  // NOLINT: GCC ignores it on `using`
  Lanes lanes{};

  Pack() = default;
  PHYXEL_HD explicit Pack(double scalar) : lanes(static_cast<T>(scalar) - Lanes{}) {}
  PHYXEL_HD explicit Pack(Lanes l) : lanes(l) {}
  PHYXEL_HD T operator[](int lane) const { return lanes[lane]; }

  PHYXEL_HD friend Pack operator+(Pack a, Pack b) { return Pack(a.lanes + b.lanes); }
  PHYXEL_HD friend Pack operator-(Pack a, Pack b) { return Pack(a.lanes - b.lanes); }
  PHYXEL_HD friend Pack operator*(Pack a, Pack b) { return Pack(a.lanes * b.lanes); }
  PHYXEL_HD friend Pack operator/(Pack a, Pack b) { return Pack(a.lanes / b.lanes); }
  PHYXEL_HD friend Pack operator-(Pack a) { return Pack(-a.lanes); }
  PHYXEL_HD friend Pack where_larger(Pack a, Pack b, Pack yes, Pack no) {
    return Pack(a.lanes > b.lanes ? yes.lanes : no.lanes);
  }
  /// True if a lane is positive.
  PHYXEL_HD friend bool any_positive(Pack a) {
    bool any = false;
    for (int l = 0; l < W; ++l) any |= a.lanes[l] > T(0);
    return any;
  }
  PHYXEL_HD friend Pack sqrt(Pack a) {
    for (int l = 0; l < W; ++l) a.lanes[l] = std::sqrt(a.lanes[l]);
    return a;
  }
};

/// W consecutive values (aligned to the pack).
template <class P, class T>
PHYXEL_HD P load(const T* values) {
  return P(*reinterpret_cast<const typename P::Lanes*>(values));
}
template <class T, int W>
PHYXEL_HD void store(T* values, Pack<T, W> pack) {
  *reinterpret_cast<typename Pack<T, W>::Lanes*>(values) = pack.lanes;
}
/// Lane by lane conversion between precisions.
template <class To, class From, int W>
PHYXEL_HD Pack<To, W> convert(Pack<From, W> pack) {
  return Pack<To, W>(__builtin_convertvector(pack.lanes, typename Pack<To, W>::Lanes));
}

namespace detail {

/// Interleaves the lower (Half = 0) or upper (Half = 1) halves of a and b: a0 b0 a1 b1 ...
template <int Half, class V, std::size_t... I>
PHYXEL_HD V zip(V a, V b, std::index_sequence<I...>) {
  constexpr int w = sizeof...(I);
  return __builtin_shufflevector(a, b, (int(I) % 2 * w + int(I) / 2 + Half * w / 2)...);
}

/// Concatenates two half rows.
template <class Half, std::size_t... I>
PHYXEL_HD auto join(Half low, Half high, std::index_sequence<I...>) {
  return __builtin_shufflevector(low, high, int(I)...);
}

/// Transposes rows of records into rows of lanes, in log2(W) rounds that interleave row r with row
/// r + rows/2.
template <int Rows, int W, class V>
PHYXEL_HD void transpose_rows(V* rows) {
  using Lanes = std::make_index_sequence<W>;
  // Without the pragmas the compiler keeps the rows in memory.
#pragma GCC unroll 8
  for (int round = W; round > 1; round /= 2) {
    V mixed[Rows];
#pragma GCC unroll 16
    for (int r = 0; r < Rows / 2; ++r) {
      mixed[2 * r] = zip<0>(rows[r], rows[r + Rows / 2], Lanes{});
      mixed[2 * r + 1] = zip<1>(rows[r], rows[r + Rows / 2], Lanes{});
    }
#pragma GCC unroll 16
    for (int r = 0; r < Rows; ++r) rows[r] = mixed[r];
  }
}

}  // namespace detail

/// Gathers W records of C values each (C a power of two, records aligned to their size) and
/// returns them transposed: out[c] holds value c of every record. Whole records are loaded and
/// shuffled, which costs a fraction of W hardware gathers.
template <int C, class T, int W>
PHYXEL_HD void load_records(const T* records, const Index* index, Pack<T, W> (&out)[C]) {
  using V = typename Pack<T, W>::Lanes;
  if constexpr (C >= W) {
    for (int chunk = 0; chunk < C / W; ++chunk) {
      V rows[W];
#pragma GCC unroll 16
      for (int l = 0; l < W; ++l) {
        rows[l] = *reinterpret_cast<const V*>(records + std::ptrdiff_t{index[l]} * C + chunk * W);
      }
      detail::transpose_rows<W, W>(rows);
#pragma GCC unroll 16
      for (int c = 0; c < W; ++c) out[chunk * W + c] = Pack<T, W>(rows[c]);
    }
  } else {
    static_assert(W == 2 * C, "a row holds one record or two");
    using Record = typename Pack<T, C>::Lanes;
    V rows[C];
#pragma GCC unroll 16
    for (int r = 0; r < C; ++r) {
      rows[r] = detail::join(
          *reinterpret_cast<const Record*>(records + std::ptrdiff_t{index[2 * r]} * C),
          *reinterpret_cast<const Record*>(records + std::ptrdiff_t{index[2 * r + 1]} * C),
          std::make_index_sequence<W>{});
    }
    detail::transpose_rows<C, W>(rows);
#pragma GCC unroll 16
    for (int c = 0; c < C; ++c) out[c] = Pack<T, W>(rows[c]);
  }
}

}  // namespace phyxel
