#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mesh/surface_topology.hpp"
#include "mesh/winding_number.hpp"

namespace phyxel {
namespace {

struct Box {
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  void add(Vec3d p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  bool holds(Vec3d p) const {
    return p.x >= low.x && p.y >= low.y && p.z >= low.z && p.x <= high.x && p.y <= high.y &&
           p.z <= high.z;
  }
};

void turn(Triangle& t) { std::swap(t[1], t[2]); }

double area(const Surface& surface, const Triangle& t) {
  return 0.5 * norm(cross(surface.position[t[1]] - surface.position[t[0]],
                          surface.position[t[2]] - surface.position[t[0]]));
}

/// Finds patches of triangles connected by edges of exactly two triangles, and turns the smaller
/// part (by area) of each to agree with the rest. @returns the number of triangles turned.
Index agree_on_outside(Surface& surface) {
  const SurfaceTopology topology = connect(surface);
  const auto n = static_cast<Index>(surface.triangle.size());
  struct Neighbour {
    Index triangle = -1;
    bool agrees = true;
  };
  std::vector<std::array<Neighbour, 3>> neighbours(n);
  std::vector<std::uint8_t> count(n, 0);
  const std::vector<SurfaceEdge>& edges = topology.edges;
  bool any = false;
  for (std::size_t k = 0, next = 0; k < edges.size(); k = next) {
    for (next = k; next < edges.size() && edges[next].low == edges[k].low &&
                   edges[next].high == edges[k].high;) {
      ++next;
    }
    if (next - k != 2) continue;
    const SurfaceEdge &a = edges[k], &b = edges[k + 1];
    const bool agrees = a.forward != b.forward;
    any |= !agrees;
    neighbours[a.triangle][count[a.triangle]++] = {b.triangle, agrees};
    neighbours[b.triangle][count[b.triangle]++] = {a.triangle, agrees};
  }
  if (!any) return 0;

  Index turned = 0;
  std::vector<std::int8_t> side(n, 0);  // 0: not reached; 1: like the first of its patch; -1: not
  std::vector<Index> patch;
  for (Index seed = 0; seed < n; ++seed) {
    if (side[seed] != 0) continue;
    side[seed] = 1;
    patch.assign(1, seed);
    double balance = 0;
    for (std::size_t k = 0; k < patch.size(); ++k) {
      const Index t = patch[k];
      balance += side[t] * area(surface, surface.triangle[t]);
      for (const Neighbour& neighbour : neighbours[t]) {
        if (neighbour.triangle < 0 || side[neighbour.triangle] != 0) continue;
        side[neighbour.triangle] = static_cast<std::int8_t>(neighbour.agrees ? side[t] : -side[t]);
        patch.push_back(neighbour.triangle);
      }
    }
    for (const Index t : patch) {
      if (side[t] * balance >= 0) continue;
      turn(surface.triangle[t]);
      ++turned;
    }
  }
  return turned;
}

}  // namespace

std::vector<std::string> orient(Surface& surface) {
  std::vector<std::string> done;
  const Index turned = agree_on_outside(surface);
  if (turned > 0) {
    done.push_back(
        fmt::format("{} triangles were turned over to agree with their neighbours", turned));
  }

  const SurfaceTopology topology = connect(surface);
  std::vector<std::vector<Triangle>> part(topology.parts);
  std::vector<Box> box(topology.parts);
  for (std::size_t t = 0; t < surface.triangle.size(); ++t) {
    part[topology.part[t]].push_back(surface.triangle[t]);
    for (const Index corner : surface.triangle[t]) {
      box[topology.part[t]].add(surface.position[corner]);
    }
  }
  std::vector<double> volume(topology.parts, 0);
  for (Index p = 0; p < topology.parts; ++p) {
    // Taken about its own middle, so that the volume of a part with a hole does not depend on its
    // position.
    const Vec3d middle = 0.5 * (box[p].low + box[p].high);
    for (const Triangle& t : part[p]) {
      volume[p] += dot(surface.position[t[0]] - middle,
                       cross(surface.position[t[1]] - middle, surface.position[t[2]] - middle)) /
                   6;
    }
  }
  // Fewer than four triangles enclose no volume, and are left as they are.
  std::vector<Index> order;
  for (Index p = 0; p < topology.parts; ++p) {
    if (part[p].size() >= 4) order.push_back(p);
  }
  if (std::none_of(order.begin(), order.end(), [&](Index p) { return volume[p] < 0; })) return done;

  // From the largest part to the smallest, so that a part comes after those that contain it.
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return std::abs(volume[a]) > std::abs(volume[b]); });
  std::vector<bool> turn_part(topology.parts, false);
  Index parts_turned = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const Index p = order[k];
    const Vec3d place = surface.position[part[p].front()[0]];
    int depth = 0;
    Index holder = -1;
    for (std::size_t before = 0; before < k; ++before) {
      const Index q = order[before];
      if (!box[q].holds(place)) continue;
      if (std::abs(direct_winding_number(surface.position, part[q], place)) < 0.5) continue;
      ++depth;
      holder = q;
    }
    // A part inside another may be a cavity (negative) or overlap it (positive): it keeps its
    // relation to the part around it.
    turn_part[p] = depth % 2 == 0 ? volume[p] < 0 : turn_part[holder];
    parts_turned += turn_part[p];
  }
  if (parts_turned == 0) return done;
  for (std::size_t t = 0; t < surface.triangle.size(); ++t) {
    if (turn_part[topology.part[t]]) turn(surface.triangle[t]);
  }
  done.push_back(parts_turned == topology.parts
                     ? std::string("the surface was inside out and has been turned")
                     : fmt::format("{} of {} parts were inside out and have been turned",
                                   parts_turned, topology.parts));
  return done;
}

}  // namespace phyxel
