/// A law for rubber with terms in both the first and the second invariant.
#pragma once

#include "phyxel/physics/laws/small_strain.hpp"

namespace phyxel {

/// A compressible Mooney–Rivlin law:
///   ψ = c₁₀ (I₁ - 3) + c₀₁ (I₂ - 3) - 2 (c₁₀ + 2 c₀₁)(J - 1) + ½ L (J - 1)²,   J = det F,
/// with I₁ = F:F, I₂ = cof F : cof F and L = λ + 2 c₁₀. At small strains it is Hooke's law of μ = 2
/// (c₁₀ + c₀₁) and λ = K - 2/3 μ. ψ is polyconvex, a sum of convex functions of F, cof F and det F,
/// as in Ciarlet 1988 (Mathematical Elasticity I, section 4.10), with a Γ(J) that is defined for
/// every F, so that an inverted body is pushed back, too. Formulas are written in G = ∇u, so that
/// small strains keep their digits; ψ is zero at rest.
template <class Real>
struct MooneyRivlin {
  static constexpr const char* name = "mooney-rivlin";
  static constexpr const char* meaning =
      "a compressible Mooney-Rivlin law for rubber, with c10, c01 and bulk_modulus in place of "
      "young and poisson; resists compression and inversion";
  static constexpr LawParameter parameters[] = {
      {.name = "c10",
       .unit = "Pa",
       .low = 1e-12,
       .high = 1e18,
       .open = false,
       .meaning = "Coefficient of I1 - 3; the shear modulus is 2 (c10 + c01).",
       .typical = 1.5e5},
      {.name = "c01",
       .unit = "Pa",
       .low = 0,
       .high = 1e18,
       .open = false,
       .meaning = "Coefficient of I2 - 3; 0: a neo-Hookean law.",
       .typical = 0.4e5},
      {.name = "bulk_modulus",
       .unit = "Pa",
       .low = 1e-12,
       .high = 1e18,
       .open = false,
       .meaning = "Bulk modulus K at small strains; more than 4/3 c01 - 2/3 c10.",
       .typical = 8.5e5}};

  /// Requires L > 0: for a negative L the energy is not convex in J, and the bound of
  /// `wave_stiffness` does not hold.
  static const char* unmet(std::span<const double> values) {
    return constants(values)[2] > 0 ? "" : "bulk_modulus > 4/3 c01 - 2/3 c10";
  }
  /// c₁₀, c₀₁ and L [Pa].
  static std::array<double, 3> constants(std::span<const double> values) {
    const double c10 = values[0], c01 = values[1], bulk_modulus = values[2];
    return {c10, c01, bulk_modulus + (2 * c10 - 4 * c01) / 3};
  }
  /// Young's modulus E [Pa] of λ and μ.
  static double hourglass_modulus(std::span<const double> values) {
    const double mu = 2 * (values[0] + values[1]), bulk_modulus = values[2];
    return 9 * bulk_modulus * mu / (3 * bulk_modulus + mu);
  }

  Real c10, c01, volume;

  /// c₁₀ (G:G - 2 m - 2 det G) + c₀₁ (H:H - 2 m - 4 det G) + ½ L (J - 1)² [J/m³], with
  /// H = cof F - I and m the sum of the principal minors of G.
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    const Real m = detail::minors(grad_u), det = determinant(grad_u);
    const Mat3<Real> h = beyond_stretch(grad_u) + grad_u;
    const Real two = Real(2), four = Real(4);
    const Real sides = fused(-two, m + det, detail::squares(grad_u));
    const Real faces = fused(-four, det, fused(-two, m, detail::squares(h)));
    const Real change = volume_change(grad_u);
    return fused(c10, sides, fused(c01, faces, Real(0.5) * volume * change * change));
  }
  /// 2 c₁₀ (G - H) + 2 c₀₁ (H - G) × F + L (J - 1) cof F [Pa], which is
  /// 2 c₁₀ F + 2 c₀₁ cof F × F + (L (J - 1) - 2 (c₁₀ + 2 c₀₁)) cof F, as F × F = 2 cof F.
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const Mat3<Real> f = identity<Real>() + grad_u, beyond = beyond_stretch(grad_u);
    const Real two = Real(2);
    const Mat3<Real> shear = fused(-two * c10, beyond, (two * c01) * tensor_cross(beyond, f));
    return fused(volume * volume_change(grad_u), cofactor(f), shear);
  }
  /// An upper bound of 2 c₁₀ + 2 c₀₁ |F × a bᵀ|² + L (a · cof F b)² [Pa], as cof F and det F are
  /// linear along a bᵀ. F × a bᵀ has the size of F between the planes across a and b, at most that
  /// of the two largest stretches; both terms are largest for a and b along the smallest.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const Real squares = fused(s.largest, s.largest, s.middle * s.middle);
    const Real area = s.largest * s.middle;
    return fused(Real(2), fused(c01, squares, c10), volume * area * area);
  }
  /// The linearisation at rest, Hooke's law in Cauchy's strain.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    const Hooke<Real> hooke{volume - Real(2) * c10, Real(2) * (c10 + c01)};
    return SmallStrain<Real>{hooke}.at_rest(volume_stiffness);
  }

 private:
  /// cof F - F = tr G I - Gᵀ - G + cof G.
  PHYXEL_HD static Mat3<Real> beyond_stretch(const Mat3<Real>& g) {
    const Real trace = g(0, 0) + g(1, 1) + g(2, 2);
    Mat3<Real> m = cofactor(g);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        m(a, b) = m(a, b) - (g(a, b) + g(b, a));
        if (a == b) m(a, b) = m(a, b) + trace;
      }
    }
    return m;
  }
  /// A × B, the tensor cross product (de Boer 1982): bilinear, symmetric, A × A = 2 cof A.
  PHYXEL_HD static Mat3<Real> tensor_cross(const Mat3<Real>& p, const Mat3<Real>& q) {
    using detail::minor;
    Mat3<Real> m;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        m(a, i) =
            minor(p(b, j), q(c, k), p(b, k), q(c, j)) + minor(q(b, j), p(c, k), q(b, k), p(c, j));
      }
    }
    return m;
  }
};

}  // namespace phyxel
