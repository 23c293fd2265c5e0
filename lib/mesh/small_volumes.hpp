/// Least volumes of phyxels beside cuts.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mesh/spacing_field.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

/// Raises the volumes of points within a spacing of a cut to at least a fifth of the cube of the
/// spacing. Cells end at cuts, and in an acute wedge between a cut and the surface a cell may have
/// hardly any volume: as a mass, it would need tiny time steps. The points within two spacings lose
/// what a point gains, in proportion to what they have above that least volume.
/// @param volume of each point [m³]. @param spacing wanted distance between the points
/// @param may_change tells whether a point's volume may change; null: every volume may
void raise_small_volumes(std::span<const Vec3d> point, const SupportCuts& cuts,
                         const SpacingField& spacing, std::vector<double>& volume,
                         const std::function<bool(std::size_t)>& may_change = {});

}  // namespace phyxel
