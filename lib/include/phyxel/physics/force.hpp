/// Forces from stresses. One matrix, the pair stress Q_i = v_i P_i A_i⁻¹ [N/m], gives the forces of
/// a phyxel on all its neighbours. Forces are the derivative of the energy Σ_i v_i ψ(F_i), so
/// momentum is conserved exactly:
///   f_i = Q_i Σ_{j in N(i)} w_ij x_ij  +  Σ_{j : i in N(j)} w_ji Q_j x_ij.
/// The first sum is a constant of the cloud (`Model::moment_offset`), the second runs over the
/// inverse neighbourhood and replaces the n×n force matrix of Farias et al. 2008, section 5.2.
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

/// The pair stress Q_i = v_i P_i A_i⁻¹ [N/m] of a phyxel.
template <class Real>
PHYXEL_HD Mat3<Real> pair_stress(Real volume, const Mat3<Real>& first_piola_stress,
                                 const Sym3<Real>& inverse_moment) {
  return volume * (first_piola_stress * inverse_moment);
}

/// Force on a phyxel from its own stress [N]; `moment_offset` is Σ_j w_ij x_ij.
template <class Real>
PHYXEL_HD Vec3<Real> own_force(const Mat3<Real>& q_i, Vec3<Real> moment_offset) {
  return q_i * moment_offset;
}

/// Adds to `force` the force on phyxel i from the stress of phyxel j, which has i as a neighbour
/// [N]. Each product is added to the sum on its own, so that it compiles to a fused multiply-add.
/// @param wx w_ji x_ij [m]
template <class Real>
PHYXEL_HD void add_neighbour_force(Vec3<Real>& force, const Mat3<Real>& q_j, Vec3<Real> wx) {
  force.x = fused(q_j(0, 0), wx.x, force.x);
  force.y = fused(q_j(1, 0), wx.x, force.y);
  force.z = fused(q_j(2, 0), wx.x, force.z);
  force.x = fused(q_j(0, 1), wx.y, force.x);
  force.y = fused(q_j(1, 1), wx.y, force.y);
  force.z = fused(q_j(2, 1), wx.y, force.z);
  force.x = fused(q_j(0, 2), wx.z, force.x);
  force.y = fused(q_j(1, 2), wx.z, force.y);
  force.z = fused(q_j(2, 2), wx.z, force.z);
}

/// Adds the same force, with x_ij [m] and w_ji given separately.
template <class Real>
PHYXEL_HD void add_neighbour_force(Vec3<Real>& force, const Mat3<Real>& q_j, Vec3<Real> x_ij,
                                   Real w_ji) {
  add_neighbour_force(force, q_j, w_ji * x_ij);
}

/// The force on phyxel i from the stress of its neighbour j [N].
template <class Real>
PHYXEL_HD Vec3<Real> neighbour_force(const Mat3<Real>& q_j, Vec3<Real> x_ij, Real w_ji) {
  Vec3<Real> force{};
  add_neighbour_force(force, q_j, x_ij, w_ji);
  return force;
}

}  // namespace phyxel
