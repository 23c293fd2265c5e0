/// Extra resistance to a change of volume, for any law.
#pragma once

#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/stretches.hpp"

namespace phyxel {

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
  /// An upper bound of k_v (a · cof F b)² [Pa], as det F is linear along a bᵀ.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const Real area = s.largest * s.middle;
    return stiffness * area * area;
  }
};

}  // namespace phyxel
