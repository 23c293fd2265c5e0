/// The connectivity of a surface's triangles.
#pragma once

#include <string>
#include <vector>

#include "phyxel/mesh.hpp"

namespace phyxel {

/// One side of a triangle. Its ends are vertices of `SurfaceTopology::corner`, smaller first.
struct SurfaceEdge {
  Index low, high;
  Index triangle;
  bool forward;  ///< True if the triangle runs from `low` to `high`.
};

/// Edges and connected parts of a surface. Vertices at exactly the same position count as one,
/// since many files repeat a vertex where its colour or texture changes. Triangles that have fewer
/// than three distinct vertices have no edges.
struct SurfaceTopology {
  std::vector<Index> corner;       ///< First vertex at the same position, shape [n_vertices].
  std::vector<SurfaceEdge> edges;  ///< Sorted, so that the sides of one edge are adjacent.
  std::vector<Index> part;         ///< Connected part of each triangle, shape [n_triangles].
  Index parts = 0;                 ///< Number of connected parts.
  /// True if each edge is used as often forwards as backwards. Then the winding number is an
  /// integer off the surface, and constant between points that no triangle separates.
  bool closed = false;
};

/// Finds the edges and the connected parts of a surface.
SurfaceTopology connect(const Surface& surface);

/// Makes the orientation of neighbouring triangles consistent, and that of parts outward: a part
/// that encloses negative volume is turned, unless it is a cavity of another part.
/// @returns one sentence for each kind of change
std::vector<std::string> orient(Surface& surface);

}  // namespace phyxel
