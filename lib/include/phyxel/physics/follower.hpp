/// Pressure that follows a deforming surface. By Nanson's formula an area A at rest becomes
/// cof(F) A, so that a pressure p on it pushes with -p cof(F) A, the force at rest times cof(F).
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

namespace detail {
/// f + linear (tr G 1 - Gᵀ) f + quadratic cof(G) f, with G = ∇u: cof(F) f if both factors are 1.
template <class Real>
PHYXEL_HD Vec3<Real> following_force(const Mat3<Real>& grad_u, Vec3<Real> rest_force, Real linear,
                                     Real quadratic) {
  const Vec3<Real> turned = transpose(grad_u) * rest_force;
  const Vec3<Real> grown = (grad_u(0, 0) + grad_u(1, 1) + grad_u(2, 2)) * rest_force - turned;
  return rest_force + (linear * grown + quadratic * (cofactor(grad_u) * rest_force));
}
}  // namespace detail

/// The present force of a pressure that follows the surface, cof(F) f [N].
/// @param rest_force its force f on the surface at rest [N]
template <class Real>
PHYXEL_HD Vec3<Real> following_force(const Mat3<Real>& grad_u, Vec3<Real> rest_force) {
  return detail::following_force(grad_u, rest_force, Real(1), Real(1));
}

/// The mean of that force on the straight way from rest to the present displacement [N], whose
/// product with the displacement is the work of the pressure wherever that depends on the two ends
/// alone: for a closed surface, or one whose edge is held.
template <class Real>
PHYXEL_HD Vec3<Real> mean_following_force(const Mat3<Real>& grad_u, Vec3<Real> rest_force) {
  return detail::following_force(grad_u, rest_force, Real(0.5), Real(1) / Real(3));
}

}  // namespace phyxel
