/// A law for rubber that survives inversion.
#pragma once

#include <cmath>

#include "phyxel/physics/laws/small_strain.hpp"

namespace phyxel {

/// The stable neo-Hookean law of Smith, de Goes and Kim 2018 (Stable Neo-Hookean Flesh Simulation,
/// equations 13 and 14):
///   ψ = μ' / 2 (I - 3) + λ' / 2 (J - α)² - μ' / 2 log(I + 1),   I = F:F, J = det F,
/// with μ' = 4/3 μ, λ' = λ + 5/6 μ and α = 1 + 3/4 μ'/λ', which is Hooke's law of λ and μ at small
/// strains. ψ is defined for every F, so that flattened and inverted bodies are pushed back.
/// Formulas are written in ∇u, so that small strains keep their digits; ψ is zero at rest.
template <class Real>
struct NeoHookean {
  static constexpr const char* name = "neo-hookean";
  static constexpr const char* meaning =
      "the stable neo-Hookean law of Smith et al. 2018, which resists compression to nothing, and "
      "inversion, too";
  static constexpr LawParameter parameters[] = {young_modulus, poisson_ratio};
  static constexpr auto constants = lame_constants;

  Hooke<Real> hooke;

  /// ψ [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    using std::log1p;
    const Real quarter = Real(0.25) * excess(grad_u), change = volume_change(grad_u);
    const Real shape = Real(0.375) * detail::squares(grad_u) -
                       Real(0.75) * (detail::minors(grad_u) + determinant(grad_u)) +
                       Real(0.5) * (quarter - log1p(quarter));
    return shear() * shape + Real(0.5) * bulk() * change * change;
  }
  /// μ' (1 - 1/(I + 1)) F + λ' (J - α) cof F [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const Mat3<Real> f = identity<Real>() + grad_u, cof = cofactor(grad_u);
    const Real trace = grad_u(0, 0) + grad_u(1, 1) + grad_u(2, 2), i = excess(grad_u);
    // F - cof F, and the excess of 1 - 1/(I + 1) over 3/4.
    const Real beyond = Real(0.25) * (i / (Real(4) + i));
    Mat3<Real> p;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        Real difference = grad_u(a, b) + grad_u(b, a) - cof(a, b);
        if (a == b) difference = difference - trace;
        p(a, b) = shear() * fused(beyond, f(a, b), Real(0.75) * difference);
      }
    }
    return fused(bulk() * volume_change(grad_u), cofactor(f), p);
  }
  /// An upper bound of μ' (1 - 1/(I + 1)) + 2 μ' (a · F b)² / (I + 1)² + λ' (a · cof F b)² [Pa],
  /// the sum of the largest values of its terms.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const Real square = s.largest * s.largest, area = s.largest * s.middle;
    const Real inverse =
        Real(1) / (Real(1) + square + s.middle * s.middle + s.smallest * s.smallest);
    return shear() * (Real(1) - inverse + Real(2) * square * inverse * inverse) +
           bulk() * area * area;
  }
  /// The linearisation at rest, Hooke's law in Cauchy's strain.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    return SmallStrain<Real>{hooke}.at_rest(volume_stiffness);
  }
  /// μ' [Pa].
  PHYXEL_HD Real shear() const { return Real(4.0 / 3.0) * hooke.mu; }
  /// λ' [Pa].
  PHYXEL_HD Real bulk() const { return fused(Real(5.0 / 6.0), hooke.mu, hooke.lambda); }

 private:
  /// I - 3.
  PHYXEL_HD static Real excess(const Mat3<Real>& g) {
    return fused(Real(2), g(0, 0) + g(1, 1) + g(2, 2), detail::squares(g));
  }
};

}  // namespace phyxel
