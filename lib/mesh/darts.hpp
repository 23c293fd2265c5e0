/// Random choices of sample points that keep a distance from each other.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "mesh/spacing_field.hpp"

namespace phyxel {

class SurfaceOnDevice;

/// Selects exactly n sample points that keep a distance from each other. Random candidates are
/// accepted if no point accepted before is within a radius, and the radius shrinks until n are
/// found. Source: McCool and Fiume 1992 (dart throwing with a shrinking radius).
/// @param spacing cube root of the volume of one point [m]
/// @param before points accepted in advance, which are not returned
std::vector<Vec3d> throw_darts(const std::vector<SampleBlock>& blocks, Index n, double spacing,
                               std::uint64_t seed, std::span<const Vec3d> before = {});

/// A maximal set of sample points at least `gap` spacings from each other and from those in
/// `before`. @param device does a part of the work; null for the host alone
std::vector<Vec3d> fill_with_darts(const std::vector<SampleBlock>& blocks,
                                   const SpacingField& spacing, double gap, std::uint64_t seed,
                                   std::span<const Vec3d> before,
                                   const SurfaceOnDevice* device = nullptr);

}  // namespace phyxel
