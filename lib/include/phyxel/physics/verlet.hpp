/// Time integration.
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

/// Störmer–Verlet, u⁺ = 2u - u⁻ + Δt² a (reference 29 of Farias et al. 2008), kept as displacement
/// and half-step velocity v = (u - u⁻)/Δt: the same trajectory, but the difference of two nearly
/// equal displacements is never taken, so float loses fewer digits.
template <class Real>
PHYXEL_HD Vec3<Real> verlet_velocity(Vec3<Real> velocity, Vec3<Real> acceleration, Real dt) {
  return fused(dt, acceleration, velocity);
}

/// The same with mass-proportional damping c [1/s], by central differences:
/// (v⁺ - v)/Δt = a - c (v⁺ + v)/2. `keep` = (1 - cΔt/2)/(1 + cΔt/2), `gain` = Δt/(1 + cΔt/2).
template <class Real>
PHYXEL_HD Vec3<Real> verlet_velocity_damped(Vec3<Real> velocity, Vec3<Real> acceleration, Real keep,
                                            Real gain) {
  return fused(keep, velocity, gain * acceleration);
}

}  // namespace phyxel
