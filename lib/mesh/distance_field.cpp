#include "mesh/distance_field.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "mesh/winding_number.hpp"
#include "model/box.hpp"

namespace phyxel {
namespace {

constexpr int edge = DistanceField::edge, side = edge + 1;
constexpr double everywhere = HUGE_VAL;
// Distances of neighbours differ by no more than what separates them; the rest is for rounding.
constexpr double slack = 1.001;

/// The number of nodes of a grid: corners of coarse cells, and nodes of the bricks that a surface
/// of an area [m²] has.
double node_count(Vec3d extent, double area, double spacing, double band) {
  const double cell = edge * spacing;
  const double corners = (extent.x / cell + 2) * (extent.y / cell + 2) * (extent.z / cell + 2);
  // Near a surface smaller than the band, all cells are bricks.
  const double bricks =
      area < 4 * band * band ? corners : area * (2 * band + 2 * cell) / (cell * cell * cell);
  return corners + DistanceField::nodes * bricks;
}

double area_of(const Surface& surface) {
  double area = 0;
  for (const Triangle& t : surface.triangle) {
    const Vec3d a = surface.position[t[0]];
    area += 0.5 * norm(cross(surface.position[t[1]] - a, surface.position[t[2]] - a));
  }
  return area;
}

/// Finds distances from a surface, with their signs.
class SignedDistances {
 public:
  explicit SignedDistances(const Surface& surface) : tree_(surface) {}

  /// Finds the distances at points along x [m]. @param start the first one. @param step from each
  /// to the next one [m]
  void fill_line(Vec3d start, double step, std::span<float> values) const {
    double before = 0;
    Index nearest = -1;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const Vec3d x = start + Vec3d{static_cast<double>(k) * step, 0, 0};
      const double found =
          tree_.distance(x, k == 0 ? everywhere : std::abs(before) + slack * step, &nearest);
      const bool has_sign = k > 0 && std::abs(before) + found > slack * step;
      before = (has_sign ? (before < 0 ? -1 : 1) : sign_at(x)) * found;
      values[k] = static_cast<float>(before);
    }
  }
  /// The unsigned distance [m], or `most` where it is larger.
  double unsigned_at(Vec3d x, double most) const { return tree_.distance(x, most); }

  /// Finds the distances at the nodes of a brick [m], shape [nodes].
  void fill(Vec3d low, double spacing, float* node) const {
    double distance[DistanceField::nodes];  // signed
    Index nearest = -1;                     // triangle
    for (int k = 0; k < DistanceField::nodes; ++k) {
      const int at[] = {k % side, k / side % side, k / (side * side)};
      const int step[] = {1, side, side * side};
      const Vec3d x = low + spacing * Vec3d{1.0 * at[0], 1.0 * at[1], 1.0 * at[2]};
      double most = everywhere;
      for (int axis = 0; axis < 3; ++axis) {
        if (at[axis] > 0) most = std::min(most, std::abs(distance[k - step[axis]]));
      }
      const double found = tree_.distance(x, most + slack * spacing, &nearest);
      double sign = 0;
      for (int axis = 0; axis < 3 && sign == 0; ++axis) {
        if (at[axis] == 0) continue;
        const double before = distance[k - step[axis]];
        // No surface is between two nodes that are farther from it than from each other.
        if (std::abs(before) + found > slack * spacing) sign = before < 0 ? -1 : 1;
      }
      distance[k] = (sign != 0 ? sign : sign_at(x)) * found;
      node[k] = static_cast<float>(distance[k]);
    }
  }

 private:
  double sign_at(Vec3d x) const { return tree_(x) > 0.5 ? -1 : 1; }

  WindingNumber tree_;
};

/// Lays the grid around a surface. The parameters are those of `distances_from`; the band grows to
/// at least two cells.
DistanceField grid_around(const Surface& surface, double spacing, double& band, double margin,
                          double most_nodes) {
  const Box box = box_around(surface.position);
  const double area = area_of(surface);
  const auto beside = [&](double h) { return std::max(margin, band + h); };
  const auto extent = [&](double h) { return box.high - box.low + 2 * beside(h) * Vec3d{1, 1, 1}; };
  while (node_count(extent(spacing), area, spacing, band) > most_nodes) spacing *= 1.25;
  band = std::max(band, 2 * spacing);
  const double cell = edge * spacing;
  const auto cells = [&](double length) {
    return std::max(1, static_cast<int>(std::ceil(length / cell)));
  };
  const Vec3d size = extent(spacing);
  DistanceField shape;
  shape.box_low = box.low;
  shape.box_high = box.high;
  shape.spacing = spacing;
  shape.low = box.low - beside(spacing) * Vec3d{1, 1, 1};
  shape.count = {cells(size.x), cells(size.y), cells(size.z)};
  return shape;
}

}  // namespace

DistanceField DistanceArrays::view() const {
  DistanceField field = shape;
  field.brick = brick.data();
  field.coarse = coarse.data();
  field.fine = fine.data();
  return field;
}

std::size_t DistanceArrays::bytes() const {
  return brick.size() * sizeof(std::int32_t) + (coarse.size() + fine.size()) * sizeof(float);
}

DistanceArrays distances_from(const Surface& surface, double spacing, double band, double margin,
                              double most_nodes) {
  DistanceArrays made;
  made.shape = grid_around(surface, spacing, band, margin, most_nodes);
  const DistanceField& shape = made.shape;
  spacing = shape.spacing;
  const double cell = edge * spacing;
  const Vec3<int> n = shape.count;
  const auto place = [&](std::int64_t k, Vec3<int> count, double offset) {
    return shape.low + cell * Vec3d{offset + static_cast<double>(k % count.x),
                                    offset + static_cast<double>(k / count.x % count.y),
                                    offset + static_cast<double>(k / count.x / count.y)};
  };

  const SignedDistances distances(surface);
  const Vec3<int> corners{n.x + 1, n.y + 1, n.z + 1};
  made.coarse.resize(static_cast<std::size_t>(corners.x) * corners.y * corners.z);
  const auto line = static_cast<std::size_t>(corners.x);
#pragma omp parallel for schedule(dynamic)
  for (std::size_t k = 0; k < made.coarse.size(); k += line) {
    distances.fill_line(place(static_cast<std::int64_t>(k), corners, 0), cell,
                        std::span(made.coarse).subspan(k, line));
  }
  made.brick.resize(static_cast<std::size_t>(n.x) * n.y * n.z);
  const double reach = band + std::sqrt(0.75) * cell;
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t k = 0; k < made.brick.size(); ++k) {
    const auto at = static_cast<std::int64_t>(k);
    const std::int64_t corner =
        at % n.x + corners.x * (at / n.x % n.y + corners.y * (at / n.x / n.y));
    // From the corner of a cell to its middle it is half a diagonal.
    const bool is_far = std::abs(made.coarse[corner]) > reach + slack * std::sqrt(0.75) * cell;
    made.brick[k] = !is_far && distances.unsigned_at(place(at, n, 0.5), reach) < reach ? 0 : -1;
  }
  std::vector<std::int64_t> with_brick;
  for (std::size_t k = 0; k < made.brick.size(); ++k) {
    if (made.brick[k] < 0) continue;
    made.brick[k] = static_cast<std::int32_t>(with_brick.size());
    with_brick.push_back(static_cast<std::int64_t>(k));
  }
  made.fine.resize(with_brick.size() * DistanceField::nodes);
#pragma omp parallel for schedule(dynamic)
  for (std::size_t b = 0; b < with_brick.size(); ++b) {
    distances.fill(place(with_brick[b], n, 0), spacing, &made.fine[b * DistanceField::nodes]);
  }

  const auto look = [&](float distance, Vec3d x) {
    if (-distance > made.depth) {
      made.depth = -distance;
      made.deepest = x;
    }
  };
  for (std::size_t k = 0; k < made.coarse.size(); ++k) {
    look(made.coarse[k], place(static_cast<std::int64_t>(k), corners, 0));
  }
  for (std::size_t k = 0; k < made.fine.size(); ++k) {
    const std::size_t of_brick = k % DistanceField::nodes;
    const int at = static_cast<int>(of_brick);
    look(made.fine[k], place(with_brick[k / DistanceField::nodes], n, 0) +
                           spacing * Vec3d{1.0 * (at % side), 1.0 * (at / side % side),
                                           1.0 * (at / side / side)});
  }
  return made;
}

}  // namespace phyxel
