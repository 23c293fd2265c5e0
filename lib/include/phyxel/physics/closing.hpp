/// Closed gradients, which satisfy the integration constraint (variational consistency). A
/// moving-least-squares gradient is exact for affine motions, yet the weights of one phyxel in the
/// gradients of its neighbours do not cancel inside a body: a uniform stress leaves forces Σ_i v_i
/// P ∂∇u_i/∂u_j that grow with the irregularity of the cloud. Each gradient is corrected by the
/// residual of its fit (hourglass.hpp),
///   ∇u_i = ∇⁰u_i + r_i ĉ_iᵀ,   r_i = Σ_j w_ij (u_j - u_i - ∇⁰u_i x_ij),
/// with a closing vector ĉ_i [1/m] for each phyxel, solved for once when the cloud is built so that
///   Σ_i v_i ∂∇u_i/∂u_j = S_j,
/// the outward area of the surface that phyxel j carries (model/closure.hpp). r is zero for affine
/// motions, so ∇u stays exact; and a uniform stress is in balance with its tractions on S. The
/// condition is the integration constraint of Chen, Wu, Yoon and You 2001 (A stabilized conforming
/// nodal integration), and this form of it is symmetric: forces are still those of an energy. With
/// b_i = Σ_j w_ij x_ij and T_i = v_i P_i, that energy's derivative is
///   f_j = Σ_k w_jk ((Q_j + Q_k) x_jk + t_j - t_k),   t = T ĉ,   Q = (T - t bᵀ) A⁻¹.
#pragma once

#include "phyxel/physics/pair_term.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The closed gradient ∇⁰u + r ĉᵀ of a phyxel, without unit. @param grad_u the fit ∇⁰u. @param pull
/// Σ_j w_ij (u_j - u_i) [m] (`add_pull`). @param moment_offset b [m]. @param closing ĉ [1/m]
template <class Real>
PHYXEL_HD Mat3<Real> closed_gradient(const Mat3<Real>& grad_u, Vec3<Real> pull,
                                     Vec3<Real> moment_offset, Vec3<Real> closing) {
  return fused_outer(pull - grad_u * moment_offset, closing, grad_u);
}

/// The closing stress t = v P ĉ [N] of a phyxel.
template <class Real>
PHYXEL_HD Vec3<Real> closing_stress(Real volume, const Mat3<Real>& first_piola_stress,
                                    Vec3<Real> closing) {
  return volume * (first_piola_stress * closing);
}

/// The pair stress with closed gradients, Q = (v P - t bᵀ) A⁻¹ [N/m]. @param pair_stress v P A⁻¹
template <class Real>
PHYXEL_HD Mat3<Real> closed_pair_stress(const Mat3<Real>& pair_stress, Vec3<Real> t,
                                        Vec3<Real> moment_offset,
                                        const Sym3<Real>& inverse_moment) {
  return fused_outer(-t, inverse_moment * moment_offset, pair_stress);
}

/// Adds to the force on phyxel i the force of closing stresses between it and its neighbour j [N].
template <class Real>
PHYXEL_HD void add_closing_force(Vec3<Real>& force, Vec3<Real> t_i, Vec3<Real> t_j, Real w_ij) {
  force = fused(w_ij, t_i - t_j, force);
}

/// The pair term of closed gradients. It sends closing stresses.
struct ClosedGradients : PairTerm {
  static constexpr bool pulls = true;
  static constexpr bool sends = true;

  /// Replaces ∇u by the closed gradient: no term before this one may change ∇u.
  template <class Real>
  PHYXEL_HD static void change_gradient(Mat3<Real>& grad_u, const Mat3<Real>& fit,
                                        const NeighbourSums<Real>& sums,
                                        const PointConstants<Real>& point) {
    grad_u = closed_gradient(fit, sums.pull, point.moment_offset, point.closing);
  }
  /// Sets the closing stress, and makes the pair stress that of closed gradients.
  template <class Real>
  PHYXEL_HD static void change_stress(PointStress<Real>& result, const Mat3<Real>& stress,
                                      const Mat3<Real>& /*fit*/, const NeighbourSums<Real>&,
                                      const PointConstants<Real>& point) {
    result.closing_stress = closing_stress(point.volume, stress, point.closing);
    result.pair_stress = closed_pair_stress(result.pair_stress, result.closing_stress,
                                            point.moment_offset, point.inverse_moment);
  }
  /// Adds the force of the closing stresses of two neighbours.
  template <class Real>
  PHYXEL_HD static void add_force(Vec3<Real>& force, Vec3<Real> t_i, Vec3<Real> t_j, Real w_ij) {
    add_closing_force(force, t_i, t_j, w_ij);
  }
};

}  // namespace phyxel
