/// The sums over neighbours that closed gradients take hundreds of times, from records that fill
/// whole lines of the cache.
#pragma once

#include <cstdint>

#include "model/row_weights.hpp"
#include "phyxel/types.hpp"

namespace phyxel::closing {

/// The neighbours of a phyxel, ascending.
struct Row {
  const Index *first, *last;
  PHYXEL_HD const Index* begin() const { return first; }
  PHYXEL_HD const Index* end() const { return last; }
};

/// The neighbours of phyxels, and what follows from where they lie. Arrays have a value for each
/// phyxel of the model, but for `neighbours`.
struct Neighbourhoods {
  const Vec3d* position;        ///< [m]
  const double* support;        ///< [m]
  const Offset* offsets;        ///< Of the rows of neighbours.
  const Index* neighbours;      ///< Ascending by global ids.
  const Sym3d* inverse_moment;  ///< A⁻¹
  const Vec3d* moment_offset;   ///< b
};

struct Differences {
  Vec3d total;   ///< Σ_k w_jk (value_k - value_j)
  Mat3d moment;  ///< Σ_k w_jk (value_k - value_j) x_jkᵀ
};

/// Records of phyxels, one of two kinds at a time, in the same memory, and sums over the records of
/// a phyxel's neighbours. x_jk is the vector from phyxel j to its neighbour k, w_jk its weight.
/// Lanes are three numbers that are added and multiplied at once, and a fourth that is ignored.
class Gathers {
 public:
  /// Numbers in a line of the cache and in records.
  static constexpr std::size_t line = 8, term_size = 2 * line, value_size = line;

  /// @param memory `term_size` numbers for each phyxel, and a line more
  explicit Gathers(double* memory) {
    const auto beyond = reinterpret_cast<std::uintptr_t>(memory) / sizeof(double) % line;
    records_ = memory + (line - beyond) % line;
  }

  /// Sets the record of phyxel k for `terms`, and destroys records for `differences`.
  PHYXEL_HD void set_term(Index k, Vec3d position, Vec3d constant, const Mat3d& linear) const {
    double* const to = records_ + static_cast<std::size_t>(k) * term_size;
    put(to, constant, position.x);
    put(to + 4, {linear(0, 0), linear(1, 0), linear(2, 0)}, position.y);
    put(to + 8, {linear(0, 1), linear(1, 1), linear(2, 1)}, position.z);
    put(to + 12, {linear(0, 2), linear(1, 2), linear(2, 2)}, 0);
  }
  /// The matrix of such a record.
  PHYXEL_HD Mat3d linear(Index k) const {
    const double* const from = records_ + static_cast<std::size_t>(k) * term_size + 4;
    Mat3d m;
    for (int r = 0; r < 3; ++r) m(r, 0) = from[r], m(r, 1) = from[4 + r], m(r, 2) = from[8 + r];
    return m;
  }
  /// Returns start + Σ_k w_jk (constant_k + linear_k x_jk), added in the order of the neighbours.
  /// @param weights of phyxel j
  template <class Lanes>
  PHYXEL_HD Vec3d terms(Index j, Row neighbours, const RowWeights& weights, Vec3d start) const {
    return weights.with([&](auto&& weight_of) {
      const double* const own = records_ + static_cast<std::size_t>(j) * term_size;
      const double x_j = own[3], y_j = own[7], z_j = own[11];
      Lanes sum{start.x, start.y, start.z, 0};
      for (const Index k : neighbours) {
        const double* const other = records_ + static_cast<std::size_t>(k) * term_size;
        const double x = other[3] - x_j, y = other[7] - y_j, z = other[11] - z_j;
        const double weight = weight_of(k, z * z + (y * y + x * x));
        const Lanes linear = lanes_at<Lanes>(other + 12) * z +
                             (lanes_at<Lanes>(other + 8) * y + lanes_at<Lanes>(other + 4) * x);
        sum += weight * (lanes_at<Lanes>(other) + linear);
      }
      return Vec3d{sum[0], sum[1], sum[2]};
    });
  }

  /// Sets the record of phyxel k for `differences`, and destroys records for `terms`.
  PHYXEL_HD void set_value(Index k, Vec3d position, Vec3d value) const {
    double* const to = records_ + static_cast<std::size_t>(k) * value_size;
    put(to, position, 0);
    put(to + 4, value, 0);
  }
  template <class Lanes>
  PHYXEL_HD Differences differences(Index j, Row neighbours, const RowWeights& weights) const {
    return weights.with([&](auto&& weight_of) {
      const double* const own = records_ + static_cast<std::size_t>(j) * value_size;
      const double x_j = own[0], y_j = own[1], z_j = own[2];
      const Lanes value = lanes_at<Lanes>(own + 4);
      Lanes total{}, column_x{}, column_y{}, column_z{};
      for (const Index k : neighbours) {
        const double* const other = records_ + static_cast<std::size_t>(k) * value_size;
        const double x = other[0] - x_j, y = other[1] - y_j, z = other[2] - z_j;
        const double weight = weight_of(k, z * z + (y * y + x * x));
        const Lanes weighted = weight * (lanes_at<Lanes>(other + 4) - value);
        total += weighted;
        column_x = weighted * x + column_x;
        column_y = weighted * y + column_y;
        column_z = weighted * z + column_z;
      }
      Differences found{.total = {total[0], total[1], total[2]}, .moment = {}};
      for (int r = 0; r < 3; ++r) {
        found.moment(r, 0) = column_x[r], found.moment(r, 1) = column_y[r],
                        found.moment(r, 2) = column_z[r];
      }
      return found;
    });
  }

 private:
  PHYXEL_HD static void put(double* to, Vec3d v, double fourth) {
    to[0] = v.x, to[1] = v.y, to[2] = v.z, to[3] = fourth;
  }
  template <class Lanes>
  PHYXEL_HD static const Lanes& lanes_at(const double* numbers) {
    return *reinterpret_cast<const Lanes*>(numbers);
  }

  double* records_;
};

/// The sums of `Gathers`, by the vector units of the host.
Vec3d terms_on_host(const Gathers& gathers, Index j, Row neighbours, const RowWeights& weights,
                    Vec3d start);
Differences differences_on_host(const Gathers& gathers, Index j, Row neighbours,
                                const RowWeights& weights);

}  // namespace phyxel::closing
