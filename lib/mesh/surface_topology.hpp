/// How the triangles of a surface hang together.
#pragma once

#include <string>
#include <vector>

#include "phyxel/mesh.hpp"

namespace phyxel {

/// One side of a triangle. Ends are named by `SurfaceTopology::corner`, smaller first.
struct SurfaceEdge {
  Index low, high;
  Index triangle;
  bool forward;  ///< The triangle runs from low to high.
};

/// Vertices at exactly the same place count as one here, since many files repeat a vertex where
/// its colour or texture changes. Triangles that are left with fewer than three vertices have no
/// edges.
struct SurfaceTopology {
  std::vector<Index> corner;       ///< First vertex at the same place, shape [n_vertices].
  std::vector<SurfaceEdge> edges;  ///< Sorted, so that the sides of one edge are adjacent.
  std::vector<Index> part;         ///< Connected part of each triangle, shape [n_triangles].
  Index parts = 0;
  /// Every edge is run through as often forwards as backwards. Then the winding number is a whole
  /// number everywhere off the surface, and constant wherever no triangle lies in between.
  bool closed = false;
};

SurfaceTopology connect(const Surface& surface);

/// Turns triangles over until neighbours agree on the outside, and parts until their outside is
/// out: a part that encloses negative volume is turned, unless it lies in another part and is its
/// cavity. @returns what was done, one sentence each.
std::vector<std::string> orient(Surface& surface);

}  // namespace phyxel
