/// Filling of a surface by scattered phyxels, for surfaces without phyxels on them: open ones,
/// overlapping ones, and bodies as thin as a phyxel.
#pragma once

#include "mesh/inside_filling.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/mesh.hpp"

namespace phyxel {

/// Number of sample points for each phyxel. More samples give centroids with less noise (the
/// smallest gap is 0.70 of the spacing with 64, 0.57 with 24) and take more memory.
double samples_per_phyxel(Index phyxels);

/// Memory that a phyxel takes while a surface is filled [bytes].
double bytes_scattered(double samples_per_phyxel);

/// Sets the positions and volumes of the cloud: random sample points far from each other, moved to
/// the centroids of their Voronoi cells in `request.relaxations` sweeps; volumes are shares of
/// sample points.
/// @param filling its blocks are used up
/// @param spacing cube root of the volume of a phyxel [m]
void fill_scattered(const InsideSampler& sampler, InsideFilling& filling,
                    const SampleRequest& request, double spacing, Cloud& cloud);

}  // namespace phyxel
