#include "mesh/surface_topology.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "parallel_sort.hpp"

namespace phyxel {
namespace {

std::vector<Index> coincident_corners(const std::vector<Vec3d>& position) {
  std::vector<Index> order(position.size()), corner(position.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](Index v) { return std::tuple(position[v].x, position[v].y, position[v].z); };
  parallel_sort(order,
                [&](Index a, Index b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  for (std::size_t k = 0; k < order.size(); ++k) {
    const bool same = k > 0 && position[order[k]] == position[order[k - 1]];
    corner[order[k]] = same ? corner[order[k - 1]] : order[k];
  }
  return corner;
}

Index root_of(std::vector<Index>& parent, Index v) {
  while (parent[v] != v) v = parent[v] = parent[parent[v]];
  return v;
}

}  // namespace

SurfaceTopology connect(const Surface& surface) {
  SurfaceTopology topology;
  topology.corner = coincident_corners(surface.position);
  const auto n_triangles = static_cast<Index>(surface.triangle.size());

  std::vector<Index> parent(surface.position.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (Index t = 0; t < n_triangles; ++t) {
    Triangle c;
    for (int k = 0; k < 3; ++k) c[k] = topology.corner[surface.triangle[t][k]];
    for (int k = 1; k < 3; ++k) {
      const Index a = root_of(parent, c[0]), b = root_of(parent, c[k]);
      parent[std::max(a, b)] = std::min(a, b);
    }
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
    for (int k = 0; k < 3; ++k) {
      const Index from = c[k], to = c[(k + 1) % 3];
      topology.edges.push_back({std::min(from, to), std::max(from, to), t, from < to});
    }
  }
  parallel_sort(topology.edges, [](const SurfaceEdge& a, const SurfaceEdge& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });

  topology.closed = true;
  for (std::size_t k = 0, next = 0; k < topology.edges.size(); k = next) {
    int balance = 0;
    for (next = k;
         next < topology.edges.size() && topology.edges[next].low == topology.edges[k].low &&
         topology.edges[next].high == topology.edges[k].high;
         ++next) {
      balance += topology.edges[next].forward ? 1 : -1;
    }
    topology.closed &= balance == 0;
  }

  std::vector<Index> number(surface.position.size(), -1);
  topology.part.resize(surface.triangle.size());
  for (Index t = 0; t < n_triangles; ++t) {
    Index& part = number[root_of(parent, topology.corner[surface.triangle[t][0]])];
    if (part < 0) part = topology.parts++;
    topology.part[t] = part;
  }
  return topology;
}

}  // namespace phyxel
