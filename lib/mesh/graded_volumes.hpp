/// Volumes of phyxels whose distances vary from place to place.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "mesh/spacing_field.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

/// The volumes of points [m³], shape [point.size()]: each gets the voxels whose sample points are
/// nearest to it. Voxels are fine where points are near each other, at least five along the wanted
/// distance. A voxel on one side of a cut goes to a point on that side. A point without voxels gets
/// half of one.
/// @param point points inside the sampled body [m]
/// @param spacing the wanted distances
/// @param seed seed of the sample points. @param stage is told the progress
std::vector<double> graded_volumes(const InsideSampler& sampler, const std::vector<Vec3d>& point,
                                   const SupportCuts& cuts, const SpacingField& spacing,
                                   std::uint64_t seed, Stage& stage);

}  // namespace phyxel
