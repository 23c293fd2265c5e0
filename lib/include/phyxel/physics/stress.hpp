/// From strain to stress: each law holds its energy and its stress side by side, the stress being
/// the derivative of the energy. Laws are plain structs without a base class; a kernel is a
/// template on the law.
#pragma once

#include "phyxel/physics/strain.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Isotropic Hooke, S = C ε = λ tr(ε) I + 2 μ ε [Pa]: equations (4) and (5) of Farias et al. 2008
/// (whose shear entries 1 - 2ν multiply the tensor shear strain).
template <class Real>
struct Hooke {
  Real lambda, mu;  ///< Lamé's parameters [Pa].

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
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return hooke.energy(cauchy_strain(grad_u));
  }
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return full(hooke.stress(cauchy_strain(grad_u)));
  }
};

/// Volume conservation, energy ½ k_v (det F - 1)². Source: Mueller et al. 2004, section 4.3.
template <class Real>
struct VolumeConservation {
  Real stiffness;  ///< k_v [Pa]

  /// det F - 1 from ∇u, without cancellation: tr G + ½(tr² G - tr G²) + det G.
  PHYXEL_HD static Real volume_change(const Mat3<Real>& g) {
    const Real minors = detail::minor(g(0, 0), g(1, 1), g(0, 1), g(1, 0)) +
                        detail::minor(g(0, 0), g(2, 2), g(0, 2), g(2, 0)) +
                        detail::minor(g(1, 1), g(2, 2), g(1, 2), g(2, 1));
    return g(0, 0) + g(1, 1) + g(2, 2) + minors + determinant(g);
  }
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
  template <class Real>
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return first.energy(grad_u) + second.energy(grad_u);
  }
  template <class Real>
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return first.first_piola_stress(grad_u) + second.first_piola_stress(grad_u);
  }
};

}  // namespace phyxel
