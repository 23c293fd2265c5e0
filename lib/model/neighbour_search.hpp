/// The steps of the neighbour search, for those who have a part of a body and ask others between.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "phyxel/neighbourhood.hpp"

namespace phyxel {

/// The value in the middle, the upper one of two. @param values at least one
double median_of(std::span<const double> values);

/// `mean_spacing`, and how far the farthest of those nearest is.
/// @param farthest [m], shape [n_phyxels]; null: not wanted
std::vector<double> mean_spacing(std::span<const Vec3d> position, int nearest, double* farthest);

/// h_i [m] by the rule. @param median of the spacings of the body
std::vector<double> support_radii(std::span<const double> spacing, const NeighbourhoodRule& rule,
                                  double median);

/// `find_neighbours` once supports are known.
Neighbourhood neighbours_within(std::span<const Vec3d> position, std::vector<double> support,
                                const NeighbourhoodRule& rule);

/// `phyxels_near` without the nearest where none reaches: such rows are empty.
///   None is larger than the largest support
Csr phyxels_reaching(std::span<const Vec3d> point, std::span<const Vec3d> position,
                     std::span<const double> support);

/// The first of the nearest, after its squared distance [m²]; -1 if there is none.
std::pair<double, Index> nearest_to(Vec3d point, std::span<const Vec3d> position);

}  // namespace phyxel
