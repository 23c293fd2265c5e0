/// Wood, layers, bone: three axes of symmetry.
///
/// S = C : E with Green's strain E (St Venant–Kirchhoff), and nine constants C in the material's
/// axes (Lekhnitskii 1963, Theory of elasticity of an anisotropic elastic body, section 5).
#pragma once

#include <cmath>
#include <sstream>
#include <string>

#include "phyxel/physics/laws/hencky.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// An orthotropic material in a user's terms. Under uniaxial stress along axis i the strain along j
/// is -ν_ij times that along i; ν_ij/E_i = ν_ji/E_j.
struct OrthotropicParameters {
  double young1 = 0, young2 = 0, young3 = 0;           ///< E₁, E₂, E₃ [Pa], > 0
  double poisson12 = 0, poisson13 = 0, poisson23 = 0;  ///< ν₁₂, ν₁₃, ν₂₃
  double shear12 = 0, shear13 = 0, shear23 = 0;        ///< G₁₂, G₁₃, G₂₃ [Pa], > 0
  Vec3d axis1{1, 0, 0};  ///< The first axis in the body at rest, of any length.
  Vec3d axis2{0, 1, 0};  ///< The second, of any length; its part along the first is taken away.
};

/// Why a material cannot be; empty if it can. Names the parameter, or the leading sub-determinant
/// of the matrix of compliance (scaled to a diagonal of ones) that is not positive, and its value.
inline std::string refusal_of(const OrthotropicParameters& p) {
  std::ostringstream text;
  const struct {
    const char* name;
    double value;
  } moduli[] = {{"young1", p.young1},   {"young2", p.young2},   {"young3", p.young3},
                {"shear12", p.shear12}, {"shear13", p.shear13}, {"shear23", p.shear23}};
  for (const auto& modulus : moduli) {
    if (!(modulus.value > 0)) {
      text << modulus.name << " is " << modulus.value << "; it must be positive [Pa]";
      return text.str();
    }
  }
  const double s12 = p.poisson12 * p.poisson12 * p.young2 / p.young1;
  const double s13 = p.poisson13 * p.poisson13 * p.young3 / p.young1;
  const double s23 = p.poisson23 * p.poisson23 * p.young3 / p.young2;
  const double all =
      1 - s12 - s13 - s23 - 2 * p.poisson12 * p.poisson13 * p.poisson23 * p.young3 / p.young1;
  const auto refuse = [&](const char* name, const char* formula, double value) {
    text << "the stiffness is not positive definite: " << name << ", " << formula << ", is "
         << value << "; it must be positive";
    return text.str();
  };
  if (!(1 - s12 > 0)) {
    return refuse("the second leading sub-determinant of the compliance", "1 - nu12^2 E2/E1",
                  1 - s12);
  }
  if (!(all > 0)) {
    return refuse("the third leading sub-determinant of the compliance",
                  "1 - nu12^2 E2/E1 - nu13^2 E3/E1 - nu23^2 E3/E2 - 2 nu12 nu13 nu23 E3/E1", all);
  }
  const Vec3d first = normalised(p.axis1);
  const Vec3d rest = p.axis2 - dot(p.axis2, first) * first;
  if (!(norm(first) > 0) || !(norm(rest) > 1e-6 * norm(p.axis2))) {
    text << "axis1 (" << p.axis1.x << ", " << p.axis1.y << ", " << p.axis1.z << ") and axis2 ("
         << p.axis2.x << ", " << p.axis2.y << ", " << p.axis2.z
         << ") must be finite, not zero and not parallel";
    return text.str();
  }
  return {};
}

/// St Venant–Kirchhoff with nine constants in the material's axes.
template <class Real>
struct Orthotropic {
  Real c11, c22, c33;  ///< [Pa] S_ii of E_ii, in the material's axes
  Real c12, c13, c23;  ///< [Pa] S_ii of E_jj
  Real g12, g13, g23;  ///< [Pa] half of S_ij of E_ij: shear moduli
  Real axes[3][3];     ///< Column i: the i-th axis of the material in the body at rest.

  /// @param p allowed parameters (refusal_of)
  static Orthotropic of(const OrthotropicParameters& p) {
    const double n12 = p.poisson12, n13 = p.poisson13, n23 = p.poisson23;
    const double e1 = p.young1, e2 = p.young2, e3 = p.young3;
    const double n21 = n12 * e2 / e1, n31 = n13 * e3 / e1, n32 = n23 * e3 / e2;
    const double all = 1 - n12 * n21 - n13 * n31 - n23 * n32 - 2 * n21 * n32 * n13;
    Orthotropic law{Real(e1 * (1 - n23 * n32) / all),
                    Real(e2 * (1 - n13 * n31) / all),
                    Real(e3 * (1 - n12 * n21) / all),
                    Real(e2 * (n12 + n32 * n13) / all),
                    Real(e3 * (n13 + n12 * n23) / all),
                    Real(e3 * (n23 + n21 * n13) / all),
                    Real(p.shear12),
                    Real(p.shear13),
                    Real(p.shear23),
                    {}};
    const Vec3d x = normalised(p.axis1);
    const Vec3d y = normalised(p.axis2 - dot(p.axis2, x) * x), z = cross(x, y);
    const Vec3d columns[3] = {x, y, z};
    for (int c = 0; c < 3; ++c) {
      law.axes[0][c] = Real(columns[c].x);
      law.axes[1][c] = Real(columns[c].y);
      law.axes[2][c] = Real(columns[c].z);
    }
    return law;
  }

  /// ½ E : S [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    const Sym3<Real> e = in_axes(green_strain(grad_u));
    return Real(0.5) * contract(e, stress(e));
  }
  /// F S [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const Mat3<Real> r = frame();
    const Mat3<Real> s = r * stress(in_axes(green_strain(grad_u))) * transpose(r);
    return fused(grad_u, s, s);
  }
  /// An upper bound of the stiffness of plane waves [Pa], whatever their direction in the
  /// material's axes (stiffening.hpp). That of a bᵀ is (w bᵀ) : C : (w bᵀ) + b·S b with w = Fᵀa.
  /// The first term is at most that of rest times the square of the largest stretch. The second is
  ///   e₁ (b bᵀ) : C : I - Σ (e₁ - e_k) (b bᵀ) : C : (n_k n_kᵀ)
  /// of principal strains e_k, the largest e₁, and directions n_k.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const auto strain = [](Real stretch) { return Real(0.5) * (stretch * stretch - Real(1)); };
    const Real most = strain(s.largest);
    const Real behind = (most - strain(s.middle)) + (most - strain(s.smallest));
    const Real r1 = c11 + c12 + c13, r2 = c12 + c22 + c23, r3 = c13 + c23 + c33;
    const Real together = larger(larger(most * r1, most * r2), most * r3);
    // (b bᵀ) : C : (n nᵀ) >= the smallest entry of C with 2 g taken from its diagonal, less 4/3 of
    // what shear moduli differ from g by.
    const Real high = larger(larger(g12, g13), g23), low = smaller(smaller(g12, g13), g23);
    const Real diagonal = smaller(smaller(c11, c22), c33) - (high + low);
    const Real least =
        smaller(diagonal, smaller(smaller(c12, c13), c23)) - Real(2.0 / 3) * (high - low);
    return fused(wave_stiffness_of_rest(), s.largest * s.largest, together - least * behind);
  }
  /// An upper bound of that at rest [Pa]: λ + 2μ where C is isotropic.
  PHYXEL_HD Real wave_stiffness_of_rest() const {
    WaveBound<Real> bound;
    bound.add_diagonal(c11), bound.add_diagonal(c22), bound.add_diagonal(c33);
    bound.add_pair(c12 + g12, g12), bound.add_pair(c13 + g13, g13), bound.add_pair(c23 + g23, g23);
    return bound.value();
  }

 private:
  PHYXEL_HD Mat3<Real> frame() const {
    Mat3<Real> r;
    for (int e = 0; e < 9; ++e) r(e / 3, e % 3) = axes[e / 3][e % 3];
    return r;
  }
  /// Rᵀ s R.
  PHYXEL_HD Sym3<Real> in_axes(const Sym3<Real>& s) const {
    const Mat3<Real> r = frame(), m = transpose(r) * full(s) * r;
    return {m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)};
  }
  /// C : e in the material's axes [Pa].
  PHYXEL_HD Sym3<Real> stress(const Sym3<Real>& e) const {
    return {fused(c13, e.zz, fused(c12, e.yy, c11 * e.xx)),
            Real(2) * g12 * e.xy,
            Real(2) * g13 * e.xz,
            fused(c23, e.zz, fused(c22, e.yy, c12 * e.xx)),
            Real(2) * g23 * e.yz,
            fused(c33, e.zz, fused(c23, e.yy, c13 * e.xx))};
  }
};

}  // namespace phyxel
