/// Phyxels on a surface: on its corners, along its sharp edges, and distributed over its faces.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/surface_topology.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

class Stage;

/// Sites on a surface, with about the spacing of the phyxels that will fill its inside.
struct SurfaceSites {
  std::vector<Vec3d> position;  ///< [m]
  /// Cube root of the volume of an interior phyxel [m]; one on a face has about half that volume.
  double spacing = 0;
};

/// Points evenly spread over the triangles of a surface, one on each `area` [m²].
/// Source of the sequence: Roberts 2018 (R2), folded from a square into the triangle.
std::vector<Vec3d> points_over(const Surface& surface, double area, std::uint64_t seed);

/// Distributes sites over a surface.
/// @param surface must be closed and must not overlap itself
/// @param volume enclosed volume [m³]
/// @param phyxels total number of phyxels, some of which are left for the inside
/// @param stage is told the progress
/// @throws InputError if there are so few phyxels that those on opposite sides would be nearer to
///   each other than those side by side
SurfaceSites sites_on(const Surface& surface, const SurfaceTopology& topology, double volume,
                      Index phyxels, std::uint64_t seed, int relaxations, Stage& stage);

}  // namespace phyxel
