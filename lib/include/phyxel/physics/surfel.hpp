/// Passive surfel advection: equation (6) of Farias et al. 2008, section 5.1.
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

/// Weighted sums over the phyxels that carry one surfel.
template <class Real>
struct SurfelBlend {
  Vec3<Real> displacement;  ///< Σ w (u_i + ∇u_i (x_s - x_i)) [m]
  Mat3<Real> gradient;      ///< Σ w ∇u_i
  Real weight{};            ///< Σ w

  /// Adds phyxel i. @param w its weight. @param x_is x_s - x_i [m]
  PHYXEL_HD void add(Real w, Vec3<Real> u_i, const Mat3<Real>& grad_u_i, Vec3<Real> x_is) {
    add(w, u_i + grad_u_i * x_is, grad_u_i);
  }
  /// Adds phyxel i. @param motion u_i + ∇u_i (x - x_i), at one point x for all phyxels [m]
  PHYXEL_HD void add(Real w, Vec3<Real> motion, const Mat3<Real>& grad_u_i) {
    displacement = fused(w, motion, displacement);
    gradient = fused(w, grad_u_i, gradient);
    weight = weight + w;
  }
  /// The displacement u_s [m].
  PHYXEL_HD Vec3<Real> surfel_displacement() const { return displacement / weight; }
  /// The displacement u_s [m] if motions were added at the point x_s - `offset`.
  PHYXEL_HD Vec3<Real> surfel_displacement(Vec3<Real> offset) const {
    return (displacement + gradient * offset) / weight;
  }
  /// Deformed normal (not unit): cof(F) n, which is det F F⁻ᵀ n and needs no inverse.
  PHYXEL_HD Vec3<Real> surfel_normal(Vec3<Real> rest_normal) const {
    return cofactor(identity<Real>() + (Real(1) / weight) * gradient) * rest_normal;
  }
};

}  // namespace phyxel
