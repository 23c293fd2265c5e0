/// The weight of a neighbour. Source: Mueller et al. 2004, section 4.2 (their equation for w).
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

/// Shape of the weight, (1 - r²/h²)³, without unit: the full weight is w(r, h) = 315 / (64 π h³) (1
/// - r²/h²)³. The constant cancels in every gradient (it stands in the moment matrix and in the
/// sum), and h⁹ would leave the range of float for small bodies, so the step uses the shape alone.
/// Valid for r < h only: lists hold no other neighbours.
template <class Real>
PHYXEL_HD Real weight_shape(Real r_squared, Real inverse_h_squared) {
  const Real t = fused(-r_squared, inverse_h_squared, Real(1));
  return t * t * t;
}

/// The shape of the weight at any distance: zero for r >= h.
template <class Real>
PHYXEL_HD Real weight_shape_anywhere(Real r_squared, Real inverse_h_squared) {
  const Real t = fused(-r_squared, inverse_h_squared, Real(1));
  const Real inside = t > Real(0) ? t : Real(0);
  return inside * inside * inside;
}

/// h/(2H), half the support of a phyxel over the length H of its body: what a phyxel gives to the
/// weights of its pairs. @param length H [m]
PHYXEL_HD double relative_half_support(double h, double length) { return h / (2 * length); }

/// The weight of a pair of phyxels whose supports differ, at any distance:
///   w_ij = η (1 - r²/h_ij²)³,   h_ij = (h_i + h_j)/2,   η = h_ij/H;
/// zero for r >= h_ij. It is the same from both sides. The factor η makes κ of hourglass control
/// (hourglass.hpp) the same for all phyxels of a graded cloud, as v ~ h³. Where all supports are H
/// the weight equals `weight_shape` to the last bit. @param half_i, half_j `relative_half_support`
/// of the two. @param inverse_length_squared 1/H² [1/m²]
template <class Real>
PHYXEL_HD Real pair_weight(Real r_squared, Real half_i, Real half_j, Real inverse_length_squared) {
  const Real size = half_i + half_j;
  const Real inverse = Real(1) / size;  // exactly rounded, on GPUs too
  const Real t = fused(-r_squared, inverse * inverse * inverse_length_squared, Real(1));
  const Real inside = where_larger(t, Real(0), t, Real(0));
  return size * (inside * inside * inside);
}

/// Full weight [1/m³], zero at r >= h. Used for densities.
PHYXEL_HD double weight(double r, double h) {
  if (r >= h) return 0;
  constexpr double factor = 315.0 / (64.0 * 3.14159265358979323846);
  return factor / (h * h * h) * weight_shape(r * r, 1 / (h * h));
}

}  // namespace phyxel
