#include "model/closing_gathers.hpp"

namespace phyxel::closing {
namespace {

/// Three components in a vector register; the fourth number is ignored.
typedef double Lanes __attribute__((vector_size(32)));  // NOLINT: GCC ignores it on `using`

PHYXEL_HD const Lanes& lanes_at(const double* numbers) {
  return *reinterpret_cast<const Lanes*>(numbers);
}
PHYXEL_HD Vec3d components(const Lanes& lanes) { return {lanes[0], lanes[1], lanes[2]}; }

}  // namespace

Vec3d Gathers::terms(Index j, std::span<const Index> neighbours, const RowWeights& weights,
                     Vec3d start) const {
  return weights.with([&](auto&& weight_of) {
    const double* const own = records_ + static_cast<std::size_t>(j) * term_size;
    const double x_j = own[3], y_j = own[7], z_j = own[11];
    Lanes sum{start.x, start.y, start.z, 0};
    for (const Index k : neighbours) {
      const double* const other = records_ + static_cast<std::size_t>(k) * term_size;
      const double x = other[3] - x_j, y = other[7] - y_j, z = other[11] - z_j;
      const double weight = weight_of(k, z * z + (y * y + x * x));
      const Lanes linear =
          lanes_at(other + 12) * z + (lanes_at(other + 8) * y + lanes_at(other + 4) * x);
      sum += weight * (lanes_at(other) + linear);
    }
    return components(sum);
  });
}

Gathers::Differences Gathers::differences(Index j, std::span<const Index> neighbours,
                                          const RowWeights& weights) const {
  return weights.with([&](auto&& weight_of) {
    const double* const own = records_ + static_cast<std::size_t>(j) * value_size;
    const double x_j = own[0], y_j = own[1], z_j = own[2];
    const Lanes value = lanes_at(own + 4);
    Lanes total{}, column_x{}, column_y{}, column_z{};
    for (const Index k : neighbours) {
      const double* const other = records_ + static_cast<std::size_t>(k) * value_size;
      const double x = other[0] - x_j, y = other[1] - y_j, z = other[2] - z_j;
      const double weight = weight_of(k, z * z + (y * y + x * x));
      const Lanes weighted = weight * (lanes_at(other + 4) - value);
      total += weighted;
      column_x = weighted * x + column_x;
      column_y = weighted * y + column_y;
      column_z = weighted * z + column_z;
    }
    Differences found{.total = components(total), .moment = {}};
    for (int r = 0; r < 3; ++r) {
      found.moment(r, 0) = column_x[r], found.moment(r, 1) = column_y[r],
                      found.moment(r, 2) = column_z[r];
    }
    return found;
  });
}

}  // namespace phyxel::closing
