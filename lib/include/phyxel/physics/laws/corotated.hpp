/// Hooke's law after removing the nearest rotation.
#pragma once

#include <cmath>

#include "phyxel/physics/laws/small_strain.hpp"
#include "phyxel/physics/rotation.hpp"

namespace phyxel {

/// Hooke's law in the stretch that remains when the nearest rotation R is removed:
///   ψ = μ |F - R|² + ½ λ (R : F - 3)²
/// (as in Müller, Dorsey, McMillan, Jagnow and Cutler 2002, for each phyxel). Stress grows in
/// proportion to stretch; an inverted body is pushed back along the shortest way.
template <class Real>
struct Corotated {
  static constexpr const char* name = "corotated";
  static constexpr const char* meaning =
      "stress in proportion to stretch, however large, after taking the nearest rotation away; "
      "resists inversion";
  static constexpr LawParameter parameters[] = {young_modulus, poisson_ratio};
  static constexpr auto constants = lame_constants;

  Hooke<Real> hooke;

  /// ψ [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    const NearestRotation<Real> r = nearest_rotation(grad_u);
    return hooke.mu * detail::squares(grad_u - r.change) +
           Real(0.5) * hooke.lambda * r.stretch * r.stretch;
  }
  /// 2 μ (F - R) + λ (R : F - 3) R [Pa]: R maximises R : F, so the derivative of R does not
  /// contribute.
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const NearestRotation<Real> r = nearest_rotation(grad_u);
    const Mat3<Real> sides = Real(2) * hooke.mu * (grad_u - r.change);
    return fused(hooke.lambda * r.stretch, identity<Real>() + r.change, sides);
  }
  /// An upper bound of 2μ + λ (R : a bᵀ)² + (λ (tr S - 3) - 2μ) dR : a bᵀ [Pa]. With c = R a, in
  /// the frame of S, (R : a bᵀ)² is (c · b)², and dR : a bᵀ is Σ (c_i b_j - c_j b_i)² / (σ_i +
  /// σ_j), between 1 - (c · b)² over the largest and over the smallest sum of two stretches; all is
  /// linear in (c · b)².
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    using std::fmax;
    const Real two_mu = Real(2) * hooke.mu;
    const Real turning = hooke.lambda * (s.largest + s.middle + s.smallest - Real(3)) - two_mu;
    // Where two stretches cancel, the rotation jumps, which no step resolves.
    const Real least(0.01F);
    const Real across = turning > Real(0) ? turning / fmax(s.middle + s.smallest, least)
                                          : turning / fmax(s.largest + s.middle, least);
    return two_mu + fmax(hooke.lambda, across);
  }
  /// The linearisation at rest, Hooke's law in Cauchy's strain.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    return SmallStrain<Real>{hooke}.at_rest(volume_stiffness);
  }
};

}  // namespace phyxel
