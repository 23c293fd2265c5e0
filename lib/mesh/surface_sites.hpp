/// Phyxels on a surface: on its corners, along its sharp edges, and distributed over its faces.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/surface_topology.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

/// Sites on a surface, with about the spacing of the phyxels that will fill its inside.
struct SurfaceSites {
  std::vector<Vec3d> position;  ///< [m]
  /// Cube root of the volume of an interior phyxel [m]; one on a face has about half that volume.
  double spacing = 0;
};

/// Distributes sites over a surface.
/// @param surface must be closed and must not overlap itself
/// @param volume enclosed volume [m³]
/// @param phyxels total number of phyxels, some of which are left for the inside
/// @throws InputError if there are so few phyxels that those on opposite sides would be nearer to
///   each other than those side by side
SurfaceSites sites_on(const Surface& surface, const SurfaceTopology& topology, double volume,
                      Index phyxels, std::uint64_t seed, int relaxations);

}  // namespace phyxel
