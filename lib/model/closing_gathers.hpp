/// The sums over neighbours that closed gradients take hundreds of times, from records that fill
/// whole lines of the cache.
#pragma once

#include <cstdint>
#include <span>

#include "bulk.hpp"
#include "model/row_weights.hpp"
#include "phyxel/types.hpp"

namespace phyxel::closing {

/// Records of phyxels, one of two kinds at a time, in the same memory, and sums over the records of
/// a phyxel's neighbours. x_jk is the vector from phyxel j to its neighbour k, w_jk its weight.
class Gathers {
 public:
  explicit Gathers(std::size_t phyxels) : memory_(phyxels * term_size + line) {
    const auto beyond = reinterpret_cast<std::uintptr_t>(memory_.data()) / sizeof(double) % line;
    records_ = memory_.data() + (line - beyond) % line;
  }

  /// Sets the record of phyxel k for `terms`, and destroys records for `differences`.
  void set_term(Index k, Vec3d position, Vec3d constant, const Mat3d& linear) {
    double* const to = records_ + static_cast<std::size_t>(k) * term_size;
    put(to, constant, position.x);
    put(to + 4, {linear(0, 0), linear(1, 0), linear(2, 0)}, position.y);
    put(to + 8, {linear(0, 1), linear(1, 1), linear(2, 1)}, position.z);
    put(to + 12, {linear(0, 2), linear(1, 2), linear(2, 2)}, 0);
  }
  /// The matrix of such a record.
  Mat3d linear(Index k) const {
    const double* const from = records_ + static_cast<std::size_t>(k) * term_size + 4;
    Mat3d m;
    for (int r = 0; r < 3; ++r) m(r, 0) = from[r], m(r, 1) = from[4 + r], m(r, 2) = from[8 + r];
    return m;
  }
  /// Returns start + Σ_k w_jk (constant_k + linear_k x_jk), added in the order of the neighbours.
  /// @param weights of phyxel j
  Vec3d terms(Index j, std::span<const Index> neighbours, const RowWeights& weights,
              Vec3d start) const;

  /// Sets the record of phyxel k for `differences`, and destroys records for `terms`.
  void set_value(Index k, Vec3d position, Vec3d value) {
    double* const to = records_ + static_cast<std::size_t>(k) * value_size;
    put(to, position, 0);
    put(to + 4, value, 0);
  }
  struct Differences {
    Vec3d total;   ///< Σ_k w_jk (value_k - value_j)
    Mat3d moment;  ///< Σ_k w_jk (value_k - value_j) x_jkᵀ
  };
  Differences differences(Index j, std::span<const Index> neighbours,
                          const RowWeights& weights) const;

 private:
  /// Numbers in a line of the cache and in records.
  static constexpr std::size_t line = 8, term_size = 2 * line, value_size = line;

  static void put(double* to, Vec3d v, double fourth) {
    to[0] = v.x, to[1] = v.y, to[2] = v.z, to[3] = fourth;
  }

  Bulk<double> memory_;  // without a type of such alignment, which gets no huge pages
  double* records_;
};

}  // namespace phyxel::closing
