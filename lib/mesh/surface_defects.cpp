#include <fmt/format.h>

#include <algorithm>

#include "mesh/surface_topology.hpp"
#include "model/cloud_check.hpp"
#include "phyxel/mesh.hpp"

namespace phyxel {

SurfaceDefects inspect_surface(const Surface& surface) {
  check_surface(surface);
  const SurfaceTopology topology = connect(surface);
  SurfaceDefects defects;
  defects.parts = topology.parts;
  bool have_example = false;
  const auto example = [&](Vec3d place) {
    if (!have_example) defects.example = place;
    have_example = true;
  };

  const std::vector<SurfaceEdge>& edges = topology.edges;
  for (std::size_t k = 0, next = 0; k < edges.size(); k = next) {
    int forward = 0;
    for (next = k; next < edges.size() && edges[next].low == edges[k].low &&
                   edges[next].high == edges[k].high;
         ++next) {
      forward += edges[next].forward;
    }
    const std::size_t count = next - k;
    const bool open = count == 1, crowded = count > 2, flipped = count == 2 && forward != 1;
    defects.open_edges += open;
    defects.crowded_edges += crowded;
    defects.flipped_edges += flipped;
    if (open || crowded || flipped) {
      example(0.5 * (surface.position[edges[k].low] + surface.position[edges[k].high]));
    }
  }

  std::vector<bool> used(surface.position.size(), false);
  for (const Triangle& t : surface.triangle) {
    const Vec3d a = surface.position[t[0]], b = surface.position[t[1]], c = surface.position[t[2]];
    const double longest = std::max({dot(b - a, b - a), dot(c - b, c - b), dot(a - c, a - c)});
    // The triangle is thinner than the rounding error of its corners.
    if (!(norm(cross(b - a, c - a)) > 1e-14 * longest)) {
      ++defects.degenerate_triangles;
      example((a + b + c) / 3.0);
    }
    for (const Index corner : t) used[corner] = true;
  }
  defects.unused_vertices = static_cast<Index>(std::count(used.begin(), used.end(), false));
  defects.inside_out = enclosed_volume(surface) < 0;
  return defects;
}

bool SurfaceDefects::clean() const {
  return open_edges == 0 && crowded_edges == 0 && flipped_edges == 0 && degenerate_triangles == 0 &&
         !inside_out;
}

std::string SurfaceDefects::describe() const {
  std::string text = parts == 1 ? "1 part" : fmt::format("{} parts", parts);
  if (clean()) {
    text += ", closed";
  }
  const auto add = [&](Index count, const char* one, const char* many) {
    if (count > 0) text += fmt::format(", {} {}", count, count == 1 ? one : many);
  };
  add(open_edges, "open edge (a hole)", "open edges (holes)");
  add(crowded_edges, "edge with more than two triangles", "edges with more than two triangles");
  add(flipped_edges, "edge whose triangles disagree on the outside",
      "edges whose triangles disagree on the outside");
  add(degenerate_triangles, "triangle without area", "triangles without area");
  if (inside_out) text += ", inside out";
  if (open_edges + crowded_edges + flipped_edges + degenerate_triangles > 0) {
    text += fmt::format("; one is near ({:.6g}, {:.6g}, {:.6g})", example.x, example.y, example.z);
  }
  add(unused_vertices, "vertex that no triangle uses", "vertices that no triangle uses");
  return text;
}

}  // namespace phyxel
