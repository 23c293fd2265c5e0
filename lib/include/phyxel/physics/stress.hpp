/// From strain to stress: each law holds its energy and its stress side by side, the stress being
/// the derivative of the energy. Laws are plain structs without a base class; a kernel is a
/// template on the law.
#pragma once

#include <cmath>

#include "phyxel/material.hpp"
#include "phyxel/physics/rotation.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Isotropic Hooke, S = C ε = λ tr(ε) I + 2 μ ε [Pa]: equations (4) and (5) of Farias et al. 2008
/// (whose shear entries 1 - 2ν multiply the tensor shear strain).
template <class Real>
struct Hooke {
  Real lambda, mu;  ///< Lamé's parameters [Pa].

  /// S [Pa] of a strain.
  PHYXEL_HD Sym3<Real> stress(const Sym3<Real>& strain) const {
    const Real pressure = lambda * trace(strain);
    const Real two_mu = Real(2) * mu;
    return {
        fused(two_mu, strain.xx, pressure), two_mu * strain.xy, two_mu * strain.xz,
        fused(two_mu, strain.yy, pressure), two_mu * strain.yz, fused(two_mu, strain.zz, pressure)};
  }
  /// ½ ε : S [J/m³].
  PHYXEL_HD Real energy(const Sym3<Real>& strain) const {
    return Real(0.5) * contract(strain, stress(strain));
  }
};

/// Hooke's law in Green's strain (St Venant–Kirchhoff): P = F S.
template <class Real>
struct GreenHooke {
  Hooke<Real> hooke;
  /// ½ ε : S [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return hooke.energy(green_strain(grad_u));
  }
  /// First Piola–Kirchhoff stress [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const Sym3<Real> s = hooke.stress(green_strain(grad_u));
    return fused(grad_u, full(s), full(s));
  }
};

/// Hooke's law in Cauchy's strain: P = S. Right for small rotations only; loses torque beyond.
template <class Real>
struct CauchyHooke {
  Hooke<Real> hooke;
  /// ½ ε : S [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return hooke.energy(cauchy_strain(grad_u));
  }
  /// First Piola–Kirchhoff stress [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return full(hooke.stress(cauchy_strain(grad_u)));
  }
};

namespace detail {
/// Sum of the principal minors: the second invariant.
template <class Real>
PHYXEL_HD Real minors(const Mat3<Real>& g) {
  return minor(g(0, 0), g(1, 1), g(0, 1), g(1, 0)) + minor(g(0, 0), g(2, 2), g(0, 2), g(2, 0)) +
         minor(g(1, 1), g(2, 2), g(1, 2), g(2, 1));
}
/// Σ g(a, b)².
template <class Real>
PHYXEL_HD Real squares(const Mat3<Real>& g) {
  Real sum = g(0, 0) * g(0, 0);
  for (int e = 1; e < 9; ++e) sum = fused(g(e / 3, e % 3), g(e / 3, e % 3), sum);
  return sum;
}
}  // namespace detail

/// det F - 1 from ∇u, without cancellation: tr G + ½(tr² G - tr G²) + det G.
template <class Real>
PHYXEL_HD Real volume_change(const Mat3<Real>& g) {
  return g(0, 0) + g(1, 1) + g(2, 2) + detail::minors(g) + determinant(g);
}

/// The stable neo-Hookean law of Smith, de Goes and Kim 2018 (Stable Neo-Hookean Flesh Simulation,
/// equations 13 and 14):
///   ψ = μ' / 2 (I - 3) + λ' / 2 (J - α)² - μ' / 2 log(I + 1),   I = F:F, J = det F,
/// with μ' = 4/3 μ, λ' = λ + 5/6 μ and α = 1 + 3/4 μ'/λ', which is Hooke's law of λ and μ at small
/// strains. Defined for every F: it pushes back where a body is flattened or turned inside out.
/// Written in ∇u, so that small strains keep their digits; zero at rest.
template <class Real>
struct NeoHooke {
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
    // F - cof F, and of what 1 - 1/(I + 1) is beyond 3/4.
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

/// Hooke's law in the stretch that is left when the nearest rotation R is taken away:
///   ψ = μ |F - R|² + ½ λ (R : F - 3)²
/// (as in Müller, Dorsey, McMillan, Jagnow and Cutler 2002, for each phyxel). Stress grows in
/// proportion to stretch; a body turned inside out is pushed back the way that is shortest.
template <class Real>
struct CorotatedHooke {
  Hooke<Real> hooke;

  /// ψ [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    const NearestRotation<Real> r = nearest_rotation(grad_u);
    return hooke.mu * detail::squares(grad_u - r.change) +
           Real(0.5) * hooke.lambda * r.stretch * r.stretch;
  }
  /// 2 μ (F - R) + λ (R : F - 3) R [Pa]: R is at a maximum of R : F, so its own change costs
  /// nothing.
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    const NearestRotation<Real> r = nearest_rotation(grad_u);
    const Mat3<Real> sides = Real(2) * hooke.mu * (grad_u - r.change);
    return fused(hooke.lambda * r.stretch, identity<Real>() + r.change, sides);
  }
};

namespace detail {
template <Elasticity, class Real>
struct ElasticLawOf {
  using type = GreenHooke<Real>;
};
template <class Real>
struct ElasticLawOf<Elasticity::cauchy_hooke, Real> {
  using type = CauchyHooke<Real>;
};
template <class Real>
struct ElasticLawOf<Elasticity::neo_hooke, Real> {
  using type = NeoHooke<Real>;
};
template <class Real>
struct ElasticLawOf<Elasticity::corotated, Real> {
  using type = CorotatedHooke<Real>;
};
}  // namespace detail

/// Each law as a type: all are made of Hooke's parameters.
template <Elasticity elasticity, class Real>
using ElasticLaw = typename detail::ElasticLawOf<elasticity, Real>::type;

/// Calls apply(law) with the law of that name: the one place where names become types.
template <class Real, class Apply>
PHYXEL_HD auto with_law(Elasticity elasticity, const Hooke<Real>& hooke, Apply&& apply) {
  if (elasticity == Elasticity::green_hooke) return apply(GreenHooke<Real>{hooke});
  if (elasticity == Elasticity::cauchy_hooke) return apply(CauchyHooke<Real>{hooke});
  if (elasticity == Elasticity::corotated) return apply(CorotatedHooke<Real>{hooke});
  return apply(NeoHooke<Real>{hooke});
}

/// Volume conservation, energy ½ k_v (det F - 1)². Source: Mueller et al. 2004, section 4.3.
template <class Real>
struct VolumeConservation {
  Real stiffness;  ///< k_v [Pa]

  /// ½ k_v (det F - 1)² [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    const Real change = volume_change(grad_u);
    return Real(0.5) * stiffness * change * change;
  }
  /// k_v (det F - 1) cof F [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return (stiffness * volume_change(grad_u)) * cofactor(identity<Real>() + grad_u);
  }
};

/// Two laws at once: energies and stresses add.
template <class First, class Second>
struct SumOf {
  First first;
  Second second;
  /// Of both [J/m³].
  template <class Real>
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return first.energy(grad_u) + second.energy(grad_u);
  }
  /// Of both [Pa].
  template <class Real>
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return first.first_piola_stress(grad_u) + second.first_piola_stress(grad_u);
  }
};

}  // namespace phyxel
