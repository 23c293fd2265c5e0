/// Hourglass control: an energy of the displacements that a phyxel's linear fit does not follow,
///   Σ_i ½ κ Σ_j w_ij |r_ij|²,   r_ij = u_j - u_i - ∇u_i x_ij,
/// which resists motions that ∇u does not see (hourglass modes). The energy is zero in affine
/// motions, and a rotation turns r without changing its length: linear and angular momentum are
/// conserved. Sources: the energy is that of Ganzenmüller 2015 (An hourglass control algorithm for
/// Lagrangian smooth particle hydrodynamics) with the weights of the moment matrix in place of w /
/// r². With these weights Σ_j w_ij r_ij x_ijᵀ = 0, since ∇u_i is the fit that minimises the energy
/// of phyxel i; the derivative of that energy by ∇u_i vanishes, and with symmetric lists and
/// weights
///   f_i = 2 κ Σ_j w_ij (u_j - u_i)  -  κ Σ_j w_ij (∇u_i + ∇u_j) x_ij.
/// The second sum is the force of a pair stress -κ ∇u (force.hpp), so the second pass needs no code
/// for it.
#pragma once

#include "phyxel/physics/pair_term.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// κ [N/m] = α E v / tr A of a phyxel inside a uniform cloud: residuals of a tenth of the distance
/// then have α times the energy of a rod of modulus E under a strain of a tenth. tr A is taken of a
/// continuum, 4π h⁵/v ∫ (1 - t²)³ t⁴ dt from 0 to 1. With weights of pairs tr A has the factor h/H:
/// κ is that of a phyxel of support H everywhere in a graded cloud, where v ~ h³.
/// @param strength α, without unit
/// @param volume v of a phyxel [m³]
/// @param support h [m]
inline double hourglass_stiffness(double strength, double young, double volume, double support) {
  constexpr double integral = 1.0 / 5 - 3.0 / 7 + 3.0 / 9 - 1.0 / 11;
  constexpr double sphere = 4 * 3.14159265358979323846;
  if (!(support > 0)) return 0;
  return strength * young * (volume / support) * (volume / support) /
         (sphere * integral * support * support * support);
}

/// The force 2 κ Σ_j w_ij (u_j - u_i) [N] of hourglass control. @param pull the sum [m]
template <class Real>
PHYXEL_HD Vec3<Real> pull_force(Real kappa, Vec3<Real> pull) {
  return (Real(2) * kappa) * pull;
}

/// The pair stress with hourglass control, Q - κ ∇u [N/m].
template <class Real>
PHYXEL_HD Mat3<Real> with_hourglass(const Mat3<Real>& pair_stress, Real kappa,
                                    const Mat3<Real>& grad_u) {
  return fused(-kappa, grad_u, pair_stress);
}

/// The pair term of hourglass control.
struct HourglassControl : PairTerm {
  static constexpr bool pulls = true;

  /// Takes κ ∇u from the pair stress, and sets the hourglass force.
  template <class Real>
  PHYXEL_HD static void change_stress(PointStress<Real>& result, const Mat3<Real>& /*stress*/,
                                      const Mat3<Real>& fit, const NeighbourSums<Real>& sums,
                                      const PointConstants<Real>& point) {
    result.pair_stress = with_hourglass(result.pair_stress, point.hourglass, fit);
    result.hourglass_force = pull_force(point.hourglass, sums.pull);
  }
};

/// Adds one neighbour's term to Σ_j w_ij |r_ij|² [m²].
template <class Real>
PHYXEL_HD void add_residual(Real& sum, Vec3<Real> u_ij, const Mat3<Real>& grad_u, Vec3<Real> x_ij,
                            Real w) {
  const Vec3<Real> r = u_ij - grad_u * x_ij;
  sum = fused(w, dot(r, r), sum);
}

/// The hourglass energy of a phyxel, ½ κ Σ_j w_ij |r_ij|² [J]. @param residual the sum [m²]
PHYXEL_HD double hourglass_energy(double kappa, double residual) { return 0.5 * kappa * residual; }

}  // namespace phyxel
