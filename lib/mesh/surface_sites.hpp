/// Phyxels on a surface: on its corners, along its sharp edges, and distributed over its faces.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/spacing_field.hpp"
#include "mesh/surface_topology.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

class InsideSampler;
class Stage;
class SurfaceOnDevice;

/// Sites on a surface and on cuts through its inside, with about the spacing of the phyxels that
/// will fill the rest.
struct SurfaceSites {
  std::vector<Vec3d> position;  ///< Sites on the surface [m].
  std::vector<Vec3d> on_cuts;   ///< Sites on cuts, inside the surface [m].
  /// Points spread evenly over the cuts [m], shape [n]; each stands for `cut_area / n` of them.
  std::vector<Vec3d> cut_points;
  double cut_area = 0;  ///< Area of all cuts [m²].
  /// Regions on whose boundaries there are sites: the walls of `cuts`, and thin ones without a
  /// wall.
  std::vector<SpaceRegion> boundaries;
  SupportCuts cuts;  ///< Regions that have space inside.
  /// Cube root of the volume of an interior phyxel; one on a face has about half that volume.
  SpacingField spacing{0};
};

/// Distributes sites over a surface and over cuts through its inside: the boundaries of regions
/// that reach into it. Sites on cuts lie inside the regions by a little more than rounding errors.
/// @param surface must be closed and must not overlap itself
/// @param sampler sampler of the surface's inside
/// @param volume enclosed volume [m³]
/// @param spacing the wanted one; the one found may be coarser
/// @param phyxels total number of phyxels, some of which are left for the inside
/// @param stage is told the progress. @param device does a part of the work; null for the host
/// alone
/// @throws InputError if there are so few phyxels that those on opposite sides would be nearer to
///   each other than those side by side
SurfaceSites sites_on(const Surface& surface, const SurfaceTopology& topology, double volume,
                      const SpacingField& spacing, const InsideSampler& sampler,
                      std::span<const SpaceRegion> cuts, Index phyxels, std::uint64_t seed,
                      int relaxations, Stage& stage, const SurfaceOnDevice* device);

}  // namespace phyxel
