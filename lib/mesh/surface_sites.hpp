/// Phyxels on a surface: on its corners, along its sharp edges, and spread over its faces.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/surface_topology.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

/// Sites on the surface, about as far from each other as those that are to fill the inside.
struct SurfaceSites {
  std::vector<Vec3d> position;  ///< [m]
  /// Cube root of the volume of a phyxel inside; one on a face has about half as much [m].
  double spacing = 0;
};

/// @param surface closed, and nowhere inside itself
/// @param volume inside [m³]
/// @param phyxels in all, of which some are left for the inside
/// @throws InputError if so few phyxels are asked for that those on opposite sides would be nearer
///   to each other than those beside each other
SurfaceSites sites_on(const Surface& surface, const SurfaceTopology& topology, double volume,
                      Index phyxels, std::uint64_t seed, int relaxations);

}  // namespace phyxel
