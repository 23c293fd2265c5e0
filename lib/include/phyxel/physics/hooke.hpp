/// Hooke's law between a strain and the stress conjugate to it.
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

/// Isotropic Hooke's law, S = C ε = λ tr(ε) I + 2 μ ε [Pa]: equations (4) and (5) of Farias et al.
/// 2008 (whose shear entries 1 - 2ν multiply the tensor shear strain).
template <class Real>
struct Hooke {
  Real lambda, mu;  ///< Lamé's parameters [Pa].

  /// The stress S [Pa] of a strain.
  PHYXEL_HD Sym3<Real> stress(const Sym3<Real>& strain) const {
    const Real pressure = lambda * trace(strain);
    const Real two_mu = Real(2) * mu;
    return {
        fused(two_mu, strain.xx, pressure), two_mu * strain.xy, two_mu * strain.xz,
        fused(two_mu, strain.yy, pressure), two_mu * strain.yz, fused(two_mu, strain.zz, pressure)};
  }
  /// The energy density ½ ε : S [J/m³] of a strain.
  PHYXEL_HD Real energy(const Sym3<Real>& strain) const {
    return Real(0.5) * contract(strain, stress(strain));
  }
};

/// Lamé's first parameter λ [Pa] of Young's modulus [Pa] and Poisson's ratio.
constexpr double lame_lambda(double young, double poisson) {
  return young * poisson / ((1 + poisson) * (1 - 2 * poisson));
}
/// The shear modulus μ [Pa], Lamé's second parameter.
constexpr double lame_mu(double young, double poisson) { return young / (2 * (1 + poisson)); }

}  // namespace phyxel
