/// Signed distances from a closed surface of any shape, known at the nodes of a grid that is fine
/// near the surface and coarse elsewhere.
#pragma once

#include <cmath>
#include <cstdint>

#include "phyxel/types.hpp"

namespace phyxel {

/// The place of a point beside a closed surface.
struct Gap {
  double distance = 0;    ///< From the surface [m]; negative inside.
  Vec3<double> normal{};  ///< Unit vector outwards, the gradient of the distance.
};

/// A field of distances, as kernels read it; whoever made it keeps the arrays. The cells of a
/// coarse grid near the surface are bricks of smaller cells. Within a cell, coarse or fine, the
/// distance is interpolated along each axis, so that it is exact beside flat faces.
struct DistanceField {
  static constexpr int edge = 8;                                      ///< Fine cells along a brick.
  static constexpr int nodes = (edge + 1) * (edge + 1) * (edge + 1);  ///< Of a brick.

  Vec3<double> low;                ///< The grid's lowest corner [m].
  double spacing = 0;              ///< Of the fine nodes [m].
  Vec3<double> box_low, box_high;  ///< Corners of the box around the surface [m].
  Vec3<int> count{};               ///< Coarse cells along each axis.
  /// Number of the brick in each coarse cell, -1 without one; x is fastest, as in all arrays here.
  const std::int32_t* brick = nullptr;
  const float* coarse = nullptr;  ///< Distances at the corners of coarse cells [m].
  const float* fine = nullptr;    ///< Distances at the nodes of each brick [m].

  /// The distance of a point from the surface. Beyond the grid it is a lower bound.
  PHYXEL_HD Gap gap(Vec3<double> x) const {
    const double cell = edge * spacing;
    const auto clamped = [](Vec3<double> v, Vec3<double> least, Vec3<double> most) {
      const auto one = [](double value, double from, double to) {
        return value < from ? from : value < to ? value : to;
      };
      return Vec3<double>{one(v.x, least.x, most.x), one(v.y, least.y, most.y),
                          one(v.z, least.z, most.z)};
    };
    const Vec3<double> extent{cell * count.x, cell * count.y, cell * count.z};
    const Vec3<double> within = clamped(x - low, {}, extent), beyond = x - low - within;
    if (dot(beyond, beyond) > 0) {
      const Vec3<double> away = x - clamped(x, box_low, box_high);
      const double distance = std::sqrt(dot(away, away));
      return {distance, (1 / distance) * away};
    }
    const auto cell_of = [](double value, double size, int cells) {
      const int k = static_cast<int>(value / size);
      return k < cells ? k : cells - 1;
    };
    const Vec3<int> at{cell_of(within.x, cell, count.x), cell_of(within.y, cell, count.y),
                       cell_of(within.z, cell, count.z)};
    const std::int64_t number = at.x + count.x * (at.y + static_cast<std::int64_t>(count.y) * at.z);
    const Vec3<double> inside = within - cell * Vec3<double>{1.0 * at.x, 1.0 * at.y, 1.0 * at.z};
    const std::int32_t here = brick[number];
    if (here < 0) {
      return interpolated(coarse, {count.x + 1, count.y + 1, 0}, at, (1 / cell) * inside, cell);
    }
    const Vec3<int> of_brick{cell_of(inside.x, spacing, edge), cell_of(inside.y, spacing, edge),
                             cell_of(inside.z, spacing, edge)};
    const Vec3<double> left =
        inside - spacing * Vec3<double>{1.0 * of_brick.x, 1.0 * of_brick.y, 1.0 * of_brick.z};
    return interpolated(fine + static_cast<std::int64_t>(here) * nodes, {edge + 1, edge + 1, 0},
                        of_brick, (1 / spacing) * left, spacing);
  }

 private:
  /// The distance within a cell of `size` [m], at `t` of its edges from its lowest corner.
  /// @param stride nodes along x and y
  PHYXEL_HD static Gap interpolated(const float* node, Vec3<int> stride, Vec3<int> cell,
                                    Vec3<double> t, double size) {
    const auto value = [&](int x, int y, int z) -> double {
      return node[cell.x + x +
                  stride.x * (cell.y + y + static_cast<std::int64_t>(stride.y) * (cell.z + z))];
    };
    const auto mean = [](double a, double b, double share) { return a + share * (b - a); };
    double along[2][2], slope_x[2][2];  // by y and z
    for (int z = 0; z < 2; ++z) {
      for (int y = 0; y < 2; ++y) {
        const double a = value(0, y, z), b = value(1, y, z);
        along[z][y] = mean(a, b, t.x);
        slope_x[z][y] = b - a;
      }
    }
    const double near = mean(along[0][0], along[0][1], t.y),
                 far = mean(along[1][0], along[1][1], t.y);
    Vec3<double> slope{
        mean(mean(slope_x[0][0], slope_x[0][1], t.y), mean(slope_x[1][0], slope_x[1][1], t.y), t.z),
        mean(along[0][1] - along[0][0], along[1][1] - along[1][0], t.z), far - near};
    const double length = std::sqrt(dot(slope, slope));
    if (!(length > 1e-6 * size)) return {mean(near, far, t.z), {0, 0, 1}};
    return {mean(near, far, t.z), (1 / length) * slope};
  }
};

/// A field of distances that has been turned and moved from where it was made.
struct PlacedDistances {
  DistanceField field;
  Mat3<double> turn = identity<double>();  ///< The rotation into place.
  Vec3<double> place{};                    ///< Where the origin of the field has gone [m].

  /// The distance of a point from the surface. Beyond the field's grid it is a lower bound.
  PHYXEL_HD Gap gap(Vec3<double> x) const {
    const Gap gap = field.gap(transpose(turn) * (x - place));
    return {gap.distance, turn * gap.normal};
  }
};

}  // namespace phyxel
