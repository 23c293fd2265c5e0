/// Values at a point, by least squares over phyxels near it.
#pragma once

#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// The share of each phyxel in the value at a point, without unit, shape [n]. They are those of a
/// quadratic polynomial, or of a linear one if there are fewer than fourteen phyxels. The linear
/// part is fitted first, and the quadratic part to what it leaves, so that directions that the
/// phyxels do not span, and terms that their layers do not tell apart, play no part.
/// @param near places of the phyxels at rest [m], at least one
/// @param reach distance at which the weight of a phyxel is zero [m]; if it reaches none, all are
///   alike
std::vector<double> shares_at(Vec3d point, std::span<const Vec3d> near, double reach);

/// The share of each phyxel in the gradient at a point [1/m], shape [n], of the same polynomials.
/// Along directions that the phyxels do not span it is zero.
std::vector<Vec3d> slopes_at(Vec3d point, std::span<const Vec3d> near, double reach);

}  // namespace phyxel
