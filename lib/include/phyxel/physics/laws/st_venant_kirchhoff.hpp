/// Hooke's law in Green's strain, the law of Farias et al. 2008.
#pragma once

#include "phyxel/physics/laws/small_strain.hpp"

namespace phyxel {

/// St Venant–Kirchhoff: P = F S with S = λ tr(E) I + 2 μ E and Green's strain E, equations (2), (4)
/// and (5) of Farias et al. 2008. The law is exact under rotation; it softens under compression and
/// no longer resists below about half the length.
template <class Real>
struct StVenantKirchhoff {
  static constexpr const char* name = "st-venant-kirchhoff";
  static constexpr const char* meaning =
      "Hooke's law in Green's strain, as in Farias et al. 2008; gives way where a body is pressed "
      "to "
      "half its length";
  static constexpr LawParameter parameters[] = {young_modulus, poisson_ratio};
  static constexpr auto constants = lame_constants;

  Hooke<Real> hooke;

  /// ½ E : S [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return hooke.energy(green_strain(grad_u));
  }
  /// F S [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const Sym3<Real> s = hooke.stress(green_strain(grad_u));
    return fused(grad_u, full(s), full(s));
  }
  /// b·S b + (λ + μ)(Fᵀa · b)² + μ |Fᵀa|² [Pa], which is largest along the largest stretch.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const auto strain = [](Real stretch) { return Real(0.5) * (stretch * stretch - Real(1)); };
    const Real all = strain(s.largest) + strain(s.middle) + strain(s.smallest);
    const Real stress = hooke.lambda * all + Real(2) * hooke.mu * strain(s.largest);
    return (hooke.lambda + Real(2) * hooke.mu) * s.largest * s.largest + stress;
  }
  /// The linearisation at rest, Hooke's law in Cauchy's strain.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    return SmallStrain<Real>{hooke}.at_rest(volume_stiffness);
  }
};

}  // namespace phyxel
