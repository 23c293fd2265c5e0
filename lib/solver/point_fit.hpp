/// Values and gradients at a point, by least squares over phyxels near it.
#pragma once

#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// The shares of phyxels in the value and in the gradient at a point.
struct PointFit {
  std::vector<double> value;    // shape [n]
  std::vector<Vec3d> gradient;  // shape [n] [1/m]
};

/// Fits a quadratic polynomial, or a linear one to fewer than fourteen phyxels. The linear part is
/// fitted first, and the quadratic part to what it leaves, so that directions that the phyxels do
/// not span, and terms that their layers do not tell apart, play no part.
/// @param near places of the phyxels at rest [m], at least one
/// @param reach distance at which the weight of a phyxel is zero [m]
PointFit fit_at(Vec3d point, std::span<const Vec3d> near, double reach);

}  // namespace phyxel
