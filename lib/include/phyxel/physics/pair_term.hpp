/// Pair terms, which change the forces between neighbours beside the law: hourglass control
/// (hourglass.hpp) and closed gradients (closing.hpp). A pair term is a struct of hooks, each of
/// which devices call at its place in a step; those that a term has no use for come from
/// `PairTerm`. `PairTerms` (point.hpp) is a list of them, for which kernels are compiled.
#pragma once

#include "phyxel/physics/strain.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Adds one neighbour's term to Σ_j w_ij (u_j - u_i) [m].
template <class Real>
PHYXEL_HD void add_pull(Vec3<Real>& sum, Vec3<Real> u_ij, Real w) {
  sum = fused(w, u_ij, sum);
}

/// Sums of the first pass over the neighbours of a phyxel.
template <class Real>
struct NeighbourSums {
  Mat3<Real> gradient;  ///< Σ_j w_ij u_ij x_ijᵀ (`add_gradient_term`).
  Vec3<Real> pull;      ///< Σ_j w_ij u_ij (`add_pull`); zero unless a term needs it.

  /// Adds a neighbour. @tparam pulls true if a term needs `pull`
  template <bool pulls>
  PHYXEL_HD void add(Vec3<Real> x_ij, Vec3<Real> u_ij, Real w_ij) {
    add_gradient_term(gradient, u_ij, w_ij * x_ij);
    if constexpr (pulls) add_pull(pull, u_ij, w_ij);
  }
};

/// Constants of a phyxel that its stress depends on.
template <class Real>
struct PointConstants {
  Real volume;                            ///< v [m³]
  Sym3<Real> inverse_moment;              ///< A⁻¹ [1/m²]
  Real hourglass{};                       ///< κ [N/m] of hourglass control.
  Vec3<Real> moment_offset{}, closing{};  ///< b [m] and ĉ [1/m] of closed gradients.
};

/// Stresses of a phyxel, from which the second pass computes forces on it and its neighbours.
template <class Real>
struct PointStress {
  Mat3<Real> pair_stress;      ///< Q [N/m]
  Vec3<Real> hourglass_force;  ///< Own force of hourglass control [N].
  Vec3<Real> closing_stress;   ///< t [N] of closed gradients.
};

/// The hooks of a pair term, all of which do nothing.
struct PairTerm {
  /// True if the term needs `NeighbourSums::pull`.
  static constexpr bool pulls = false;
  /// True if the second pass needs the closing stresses of neighbours (`PointStress`).
  static constexpr bool sends = false;

  /// Changes the displacement gradient ∇u that the law is given.
  /// @param fit the linear fit of the neighbours' displacements
  template <class Real>
  PHYXEL_HD static void change_gradient([[maybe_unused]] Mat3<Real>& grad_u,
                                        [[maybe_unused]] const Mat3<Real>& fit,
                                        [[maybe_unused]] const NeighbourSums<Real>& sums,
                                        [[maybe_unused]] const PointConstants<Real>& point) {}
  /// Changes the stresses of a phyxel.
  /// @param stress P [Pa] of the law. @param fit as above
  template <class Real>
  PHYXEL_HD static void change_stress([[maybe_unused]] PointStress<Real>& result,
                                      [[maybe_unused]] const Mat3<Real>& stress,
                                      [[maybe_unused]] const Mat3<Real>& fit,
                                      [[maybe_unused]] const NeighbourSums<Real>& sums,
                                      [[maybe_unused]] const PointConstants<Real>& point) {}
  /// Adds to the force on phyxel i [N] that of its neighbour j.
  /// @param sent_i,sent_j closing stresses of the two, if the term sends them
  template <class Real>
  PHYXEL_HD static void add_force([[maybe_unused]] Vec3<Real>& force,
                                  [[maybe_unused]] Vec3<Real> sent_i,
                                  [[maybe_unused]] Vec3<Real> sent_j, [[maybe_unused]] Real w_ij) {}
};

}  // namespace phyxel
