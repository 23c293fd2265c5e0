/// Explicit time integration.
#pragma once

#include <cmath>

#include "phyxel/types.hpp"

namespace phyxel {

/// Störmer–Verlet, u⁺ = 2u - u⁻ + Δt² a (reference 29 of Farias et al. 2008), stored as
/// displacement and half-step velocity v = (u - u⁻)/Δt: the trajectory is the same, but no
/// difference of two nearly equal displacements is taken, so float loses fewer digits.
template <class Real>
PHYXEL_HD Vec3<Real> verlet_velocity(Vec3<Real> velocity, Vec3<Real> acceleration, Real dt) {
  return fused(dt, acceleration, velocity);
}

/// The exact flow of dv/dt = a - c v over a time under a constant acceleration a:
/// v⁺ = keep v + gain a with keep = e^{-ct} and gain = (1 - e^{-ct})/c.
struct DampedFlow {
  double keep = 1, gain = 0;  ///< [1], [s]
};

/// The flow of mass-proportional damping c over a time t. It is computed once for a body, on the
/// host; without damping, keep is exactly 1 and gain exactly t.
/// @param damping c [1/s], at least 0. @param time t [s]
inline DampedFlow damped_flow(double damping, double time) {
  const double x = damping * time;
  if (!(x > 0)) return {1, time};
  return {std::exp(-x), time * (-std::expm1(-x) / x)};
}

/// The half-step velocity v(-t) [m/s] from which the damped flow reaches v(0) = `velocity` under
/// `acceleration` at t = 0: the start of leapfrog. Growth is cut off at ct = 40, where only 1e-17
/// of the velocity survives a step, so that nothing overflows.
inline Vec3<double> velocity_before(Vec3<double> velocity, Vec3<double> acceleration,
                                    double damping, double time) {
  const Vec3<double> rest = velocity - damped_flow(damping, time).gain * acceleration;
  return std::exp(std::fmin(damping * time, 40.0)) * rest;
}

/// The velocity [m/s] after a step with mass-proportional damping c [1/s], by the exact flow over
/// Δt (`damped_flow`): a free body's velocity decays as e^{-ct} for any c Δt, and forces balance
/// damping at v = a/c. The step is stable for ω²Δt² < 2 x coth(x/2) with x = cΔt, a limit of at
/// least 4, that without damping. Distances have a relative error of x²/24.
template <class Real>
PHYXEL_HD Vec3<Real> verlet_velocity_damped(Vec3<Real> velocity, Vec3<Real> acceleration, Real keep,
                                            Real gain) {
  return fused(keep, velocity, gain * acceleration);
}

/// The force [N] of a support over a step: the one that brings a phyxel to the prescribed velocity
/// where all other forces lead to the velocity `free` (both in m/s). It is zero along free axes,
/// where the two are equal.
/// @param inertia mass over the gain of the step (`DampedFlow`) [kg/s]
PHYXEL_HD Vec3<double> support_force(double inertia, Vec3<double> prescribed, Vec3<double> free) {
  return inertia * (prescribed - free);
}

/// The correction of a state (u, v) at t with which Verlet's method changes its step. With the
/// acceleration a and its derivative a'(w) along a vector w,
///
///   u⁺ = u + first a + displacement a'(a),   v⁺ = v - first a'(v) + velocity a'(a'(v)).
///
/// Leapfrog keeps ½ v² + ½ ω² (1 - x) u² of a mode of frequency ω, with x = ω²Δt²/4. When the step
/// changes, this energy jumps by an amount that depends on the phase, so that bodies whose steps
/// change often gain energy. u⁺ = s u, v⁺ = v/s with s⁴ = (1 - x)/(1 - x⁺) keeps the action of the
/// mode, whatever its phase. The coefficients give s and 1/s to second order in x. Modes beyond x =
/// 1, which a step makes unstable, have no action to keep.
struct StepChange {
  double first = 0;         ///< [s²]
  double displacement = 0;  ///< [s⁴]
  double velocity = 0;      ///< [s⁴]
};

/// Computes the coefficients for a change of the step.
/// @param before step size until now [s]. @param after step size from now on [s]
inline StepChange step_change(double before, double after) {
  const double a = before * before, b = after * after;
  const double square = (a - b) * (a - b) / 512, difference = (a * a - b * b) / 128;
  return {(a - b) / 16, square - difference, square + difference};
}

}  // namespace phyxel
