/// Distances from triangles.
#pragma once

#include <cstddef>

#include "phyxel/types.hpp"

namespace phyxel {

/// A point on a vertex, an edge or a triangle, with the index of that piece.
struct PointOn {
  std::size_t piece;
  Vec3d point;
};

/// The corners of a triangle [m].
struct Corners {
  Vec3d a, b, c;
};

/// The point of a triangle nearest to `p`. Source: Ericson 2005, section 5.1.5.
PHYXEL_HD Vec3d nearest_on_triangle(Vec3d p, Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp),
               d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  if (d6 >= 0 && d5 <= d6) return c;
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + (d1 / (d1 - d3)) * ab;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + (d2 / (d2 - d6)) * ac;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + ((d4 - d3) / (d4 - d3 + d5 - d6)) * (c - b);
  const double all = va + vb + vc;
  return a + (vb / all) * ab + (vc / all) * ac;
}

}  // namespace phyxel
