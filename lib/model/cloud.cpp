#include "phyxel/cloud.hpp"

#include <algorithm>
#include <numeric>

#include "model/box.hpp"
#include "model/cloud_check.hpp"
#include "parallel_sort.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Spreads the low 21 bits of `v` so that two zero bits follow each.
std::uint64_t spread_bits(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  v = (v | v << 2) & 0x1249249249249249;
  return v;
}

template <class T>
void permute(std::vector<T>& values, const std::vector<Index>& order) {
  if (values.empty()) return;
  values = tabulated(order.size(), [&](std::size_t k) { return values[order[k]]; });
}

}  // namespace

std::vector<Vec3d> vertex_normals(const std::vector<Vec3d>& position,
                                  const std::vector<Triangle>& triangle) {
  check_triangles(triangle, position.size());
  std::vector<Vec3d> normal(position.size());
  for (const Triangle& t : triangle) {
    const Vec3d area = cross(position[t[1]] - position[t[0]], position[t[2]] - position[t[0]]);
    for (const Index corner : t) normal[corner] += area;
  }
  for (Vec3d& n : normal) n = normalised(n);
  return normal;
}

double enclosed_volume(const Surface& surface) {
  check_triangles(surface.triangle, surface.position.size());
  // Taken about the first vertex, so that a body far from the origin loses no digits.
  const Vec3d origin = surface.position.empty() ? Vec3d{} : surface.position.front();
  double six_volumes = 0;
  for (const Triangle& t : surface.triangle) {
    six_volumes += dot(surface.position[t[0]] - origin,
                       cross(surface.position[t[1]] - origin, surface.position[t[2]] - origin));
  }
  return six_volumes / 6;
}

void order_along_curve(Cloud& cloud) {
  const std::size_t n = cloud.position.size();
  if (n < 2) return;
  const Box box = box_around(cloud.position);
  const double extent = box.extent();
  const double scale = extent > 0 ? 2097151.0 / extent : 0;
  auto key = in_bulk(n, [&](std::size_t i) {
    const Vec3d cell = scale * (cloud.position[i] - box.low);
    return std::pair{spread_bits(static_cast<std::uint64_t>(cell.x)) |
                         spread_bits(static_cast<std::uint64_t>(cell.y)) << 1 |
                         spread_bits(static_cast<std::uint64_t>(cell.z)) << 2,
                     static_cast<Index>(i)};
  });
  parallel_sort(key);
  const std::vector<Index> order = tabulated(n, [&](std::size_t k) { return key[k].second; });
  release(key);
  reorder(cloud, order);
}

void reorder(Cloud& cloud, const std::vector<Index>& order) {
  check_order(cloud, order);
  std::vector<Index> place(order.size());
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < order.size(); ++k) place[order[k]] = static_cast<Index>(k);
  permute(cloud.position, order);
  permute(cloud.volume, order);
  permute(cloud.spacing, order);
  for (auto& [name, members] : cloud.regions) {
    for (Index& i : members) i = place[i];
    std::sort(members.begin(), members.end());
  }
}

}  // namespace phyxel
