/// An orthotropic law (wood, layers, bone), with three axes of symmetry.
///
/// S = C : E with Green's strain E (St Venant–Kirchhoff), and nine constants C in the material's
/// axes (Lekhnitskii 1963, Theory of elasticity of an anisotropic elastic body, section 5).
#pragma once

#include <array>
#include <cmath>
#include <span>

#include "phyxel/physics/laws/hencky.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Nine constants of a stiffness tensor and the material's axes.
template <class Real>
struct OrthotropicStiffness {
  Real c11, c22, c33;  ///< S_ii per E_ii, in the material's axes [Pa].
  Real c12, c13, c23;  ///< S_ii per E_jj [Pa].
  Real g12, g13, g23;  ///< Shear moduli, half of S_ij per E_ij [Pa].
  Real axes[3][3];     ///< Column i: the i-th axis of the material in the body at rest.

  /// The energy density ½ e : C : e [J/m³].
  PHYXEL_HD Real energy(const Sym3<Real>& strain) const {
    const Sym3<Real> e = in_axes(strain);
    return Real(0.5) * contract(e, stress_in_axes(e));
  }
  /// The stress C : e [Pa].
  PHYXEL_HD Mat3<Real> stress(const Sym3<Real>& strain) const {
    const Mat3<Real> r = frame();
    return r * full(stress_in_axes(in_axes(strain))) * transpose(r);
  }
  /// An upper bound of the stiffness of plane waves at rest [Pa]: λ + 2μ where C is isotropic.
  PHYXEL_HD Real wave_stiffness() const {
    WaveBound<Real> bound;
    bound.add_diagonal(c11), bound.add_diagonal(c22), bound.add_diagonal(c33);
    bound.add_pair(c12 + g12, g12), bound.add_pair(c13 + g13, g13), bound.add_pair(c23 + g23, g23);
    return bound.value();
  }
  /// The tensor with the stiffness of volume conservation [Pa] added.
  PHYXEL_HD OrthotropicStiffness with_volume(Real volume_stiffness) const {
    OrthotropicStiffness both = *this;
    for (Real* c : {&both.c11, &both.c22, &both.c33, &both.c12, &both.c13, &both.c23}) {
      *c = *c + volume_stiffness;
    }
    return both;
  }

 private:
  PHYXEL_HD Mat3<Real> frame() const {
    Mat3<Real> r;
    for (int e = 0; e < 9; ++e) r(e / 3, e % 3) = axes[e / 3][e % 3];
    return r;
  }
  /// The components Rᵀ e R of a tensor in the material's axes.
  PHYXEL_HD Sym3<Real> in_axes(const Sym3<Real>& e) const {
    const Mat3<Real> r = frame(), m = transpose(r) * full(e) * r;
    return {m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)};
  }
  /// C : e in the material's axes [Pa].
  PHYXEL_HD Sym3<Real> stress_in_axes(const Sym3<Real>& e) const {
    return {fused(c13, e.zz, fused(c12, e.yy, c11 * e.xx)),
            Real(2) * g12 * e.xy,
            Real(2) * g13 * e.xz,
            fused(c23, e.zz, fused(c22, e.yy, c12 * e.xx)),
            Real(2) * g23 * e.yz,
            fused(c33, e.zz, fused(c23, e.yy, c13 * e.xx))};
  }
};

/// The linear law with nine constants, P = C : ε with Cauchy's strain: the linearisation of
/// `Orthotropic` at rest.
template <class Real>
struct SmallStrainOrthotropic {
  OrthotropicStiffness<Real> stiffness;

  /// P [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return stiffness.stress(cauchy_strain(grad_u));
  }
  /// An upper bound of the stiffness of plane waves [Pa], in every state.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>&) const {
    return stiffness.wave_stiffness();
  }
};

/// The St Venant–Kirchhoff law with nine constants in the material's axes.
template <class Real>
struct Orthotropic {
  static constexpr const char* name = "orthotropic";
  static constexpr const char* meaning =
      "wood, layers, bone: nine constants along three axes, in Green's strain; the paper's tensor "
      "C "
      "without its isotropy";

 private:
  static constexpr LawParameter modulus(const char* key, const char* about, double typical) {
    return {.name = key,
            .unit = "Pa",
            .low = 1e-12,
            .high = 1e18,
            .open = false,
            .meaning = about,
            .typical = typical};
  }
  static constexpr LawParameter ratio(const char* key, const char* about, double typical) {
    return {.name = key,
            .unit = "",
            .low = -1e3,
            .high = 1e3,
            .open = false,
            .meaning = about,
            .typical = typical};
  }
  static constexpr LawParameter axis(const char* key, const char* about, double x, double y) {
    return {.name = key,
            .unit = "",
            .low = -1e12,
            .high = 1e12,
            .open = false,
            .meaning = about,
            .count = 3,
            .vector_fallback = {x, y, 0}};
  }

 public:
  static constexpr LawParameter parameters[] = {
      modulus("young1", "Young's modulus along the first axis.", 1.2e6),
      modulus("young2", "Young's modulus along the second axis.", 8e5),
      modulus("young3", "Young's modulus along the third axis.", 5e5),
      ratio("poisson12",
            "Poisson's ratio: strain along axis 2 is -poisson12 times that along axis 1, under "
            "stress "
            "along axis 1. poisson21 = poisson12 young2/young1.",
            0.3),
      ratio("poisson13", "Poisson's ratio of axes 1 and 3, likewise.", 0.25),
      ratio("poisson23", "Poisson's ratio of axes 2 and 3, likewise.", 0.2),
      modulus("shear12", "Shear modulus between axes 1 and 2.", 4e5),
      modulus("shear13", "Shear modulus between axes 1 and 3.", 3e5),
      modulus("shear23", "Shear modulus between axes 2 and 3.", 2.5e5),
      axis("axis1", "The first axis in the placed body at rest, of any length.", 1, 0),
      axis("axis2",
           "The second axis, of any length, not parallel to the first; its part along the first is "
           "taken away.",
           0, 1)};

  /// Names the leading sub-determinant of the compliance, scaled to a diagonal of ones, that is not
  /// positive: then the stiffness is not positive definite either.
  static const char* unmet(std::span<const double> p) {
    const double e1 = p[0], e2 = p[1], e3 = p[2], n12 = p[3], n13 = p[4], n23 = p[5];
    const double s12 = n12 * n12 * e2 / e1, s13 = n13 * n13 * e3 / e1, s23 = n23 * n23 * e3 / e2;
    if (!(1 - s12 > 0)) {
      return "a positive definite stiffness: its second sub-determinant, 1 - poisson12^2 "
             "young2/young1, > 0";
    }
    if (!(1 - s12 - s13 - s23 - 2 * n12 * n13 * n23 * e3 / e1 > 0)) {
      return "a positive definite stiffness: its third sub-determinant, 1 - poisson12^2 "
             "young2/young1 - poisson13^2 young3/young1 - poisson23^2 young3/young2 - 2 poisson12 "
             "poisson13 poisson23 young3/young1, > 0";
    }
    const Vec3d x = normalised(Vec3d{p[9], p[10], p[11]}), second{p[12], p[13], p[14]};
    const Vec3d rest = second - dot(second, x) * x;
    if (!(norm(x) > 0) || !(norm(rest) > 1e-6 * norm(second))) {
      return "axis1 and axis2 that are not zero and not parallel";
    }
    return "";
  }
  /// The members of `OrthotropicStiffness`.
  static std::array<double, 18> constants(std::span<const double> p) {
    const double e1 = p[0], e2 = p[1], e3 = p[2], n12 = p[3], n13 = p[4], n23 = p[5];
    const double n21 = n12 * e2 / e1, n31 = n13 * e3 / e1, n32 = n23 * e3 / e2;
    const double all = 1 - n12 * n21 - n13 * n31 - n23 * n32 - 2 * n21 * n32 * n13;
    const Vec3d second{p[12], p[13], p[14]};
    const Vec3d x = normalised(Vec3d{p[9], p[10], p[11]});
    const Vec3d y = normalised(second - dot(second, x) * x), z = cross(x, y);
    return {e1 * (1 - n23 * n32) / all,
            e2 * (1 - n13 * n31) / all,
            e3 * (1 - n12 * n21) / all,
            e2 * (n12 + n32 * n13) / all,
            e3 * (n13 + n12 * n23) / all,
            e3 * (n23 + n21 * n13) / all,
            p[6],
            p[7],
            p[8],
            x.x,
            y.x,
            z.x,
            x.y,
            y.y,
            z.y,
            x.z,
            y.z,
            z.z};
  }
  /// The smallest of the three E [Pa].
  static double hourglass_modulus(std::span<const double> p) {
    const double least = p[0] < p[1] ? p[0] : p[1];
    return least < p[2] ? least : p[2];
  }

  OrthotropicStiffness<Real> stiffness;

  /// ½ E : C : E [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return stiffness.energy(green_strain(grad_u));
  }
  /// F C : E [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const Mat3<Real> s = stiffness.stress(green_strain(grad_u));
    return fused(grad_u, s, s);
  }
  /// The linearisation at rest, with the same constants in Cauchy's strain.
  PHYXEL_HD SmallStrainOrthotropic<Real> at_rest(Real volume_stiffness) const {
    return {stiffness.with_volume(volume_stiffness)};
  }
  /// An upper bound of the stiffness of plane waves [Pa], whatever their direction in the
  /// material's axes (physics/law.hpp). The stiffness of a bᵀ is (w bᵀ) : C : (w bᵀ) + b·S b with w
  /// = Fᵀa. The first term is at most its value at rest times the square of the largest stretch.
  /// The second is
  ///   e₁ (b bᵀ) : C : I - Σ (e₁ - e_k) (b bᵀ) : C : (n_k n_kᵀ)
  /// with the principal strains e_k, e₁ the largest, and their directions n_k.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const OrthotropicStiffness<Real>& c = stiffness;
    const auto strain = [](Real stretch) { return Real(0.5) * (stretch * stretch - Real(1)); };
    const Real most = strain(s.largest);
    const Real behind = (most - strain(s.middle)) + (most - strain(s.smallest));
    const Real r1 = c.c11 + c.c12 + c.c13, r2 = c.c12 + c.c22 + c.c23, r3 = c.c13 + c.c23 + c.c33;
    const Real together = larger(larger(most * r1, most * r2), most * r3);
    // (b bᵀ) : C : (n nᵀ) >= the smallest entry of C with 2 g subtracted from its diagonal, less
    // 4/3 of the largest difference of a shear modulus from g.
    const Real high = larger(larger(c.g12, c.g13), c.g23),
               low = smaller(smaller(c.g12, c.g13), c.g23);
    const Real diagonal = smaller(smaller(c.c11, c.c22), c.c33) - (high + low);
    const Real least =
        smaller(diagonal, smaller(smaller(c.c12, c.c13), c.c23)) - Real(2.0 / 3) * (high - low);
    return fused(c.wave_stiffness(), s.largest * s.largest, together - least * behind);
  }
};

}  // namespace phyxel
