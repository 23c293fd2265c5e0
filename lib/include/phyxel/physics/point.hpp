/// The update of one phyxel in a step: from the sums over its neighbours to its pair stress, and
/// from its force to its displacement. Devices share this code and supply only neighbours and
/// storage.
#pragma once

#include <type_traits>

#include "phyxel/physics/closing.hpp"
#include "phyxel/physics/force.hpp"
#include "phyxel/physics/hourglass.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// A list of pair terms, in the order in which they change stresses.
template <class... Terms>
struct PairTerms {
  /// True if a term needs `NeighbourSums::pull`.
  static constexpr bool pulls = (Terms::pulls || ...);
  /// True if a term sends closing stresses.
  static constexpr bool sends = (Terms::sends || ...);
  static_assert((0 + ... + int{Terms::sends}) <= 1, "neighbours are sent one vector");
  /// True if `Term` is in the list.
  template <class Term>
  static constexpr bool has = (std::is_same_v<Term, Terms> || ...);

  /// The displacement gradient ∇u that the law is given. @param fit the linear fit of the
  /// neighbours' displacements
  template <class Real>
  PHYXEL_HD static Mat3<Real> gradient(const Mat3<Real>& fit, const NeighbourSums<Real>& sums,
                                       const PointConstants<Real>& point) {
    Mat3<Real> grad_u = fit;
    (Terms::change_gradient(grad_u, fit, sums, point), ...);
    return grad_u;
  }
  /// The stresses of a phyxel. @param stress P [Pa] of the law
  template <class Real>
  PHYXEL_HD static PointStress<Real> stresses(const Mat3<Real>& stress, const Mat3<Real>& fit,
                                              const NeighbourSums<Real>& sums,
                                              const PointConstants<Real>& point) {
    PointStress<Real> result;
    result.pair_stress = pair_stress(point.volume, stress, point.inverse_moment);
    (Terms::change_stress(result, stress, fit, sums, point), ...);
    return result;
  }
  /// Adds to the force on phyxel i [N] the forces of all terms between it and its neighbour j.
  template <class Real>
  PHYXEL_HD static void add_forces(Vec3<Real>& force, [[maybe_unused]] Vec3<Real> sent_i,
                                   [[maybe_unused]] Vec3<Real> sent_j, [[maybe_unused]] Real w_ij) {
    (Terms::add_force(force, sent_i, sent_j, w_ij), ...);
  }
};

// The lists for which kernels are compiled.

/// The list without a term.
using NoPairTerms = PairTerms<>;
/// The list of hourglass control alone.
using WithHourglass = PairTerms<HourglassControl>;
/// The list of closed gradients. It includes hourglass control, which costs nothing beside them; κ
/// is zero without.
using WithClosing = PairTerms<ClosedGradients, HourglassControl>;

/// The stresses of a phyxel.
/// @tparam Terms a list of pair terms. @param stress_of function that returns P [Pa] of ∇u by the
/// law and its history
template <class Terms, class Real, class StressOf>
PHYXEL_HD PointStress<Real> point_stress(const NeighbourSums<Real>& sums,
                                         const PointConstants<Real>& point, StressOf&& stress_of) {
  const Mat3<Real> fit = displacement_gradient(sums.gradient, point.inverse_moment);
  const Mat3<Real> stress = stress_of(Terms::gradient(fit, sums, point));
  return Terms::stresses(stress, fit, sums, point);
}

/// Velocity [m/s] and displacement [m] of a phyxel.
template <class Real>
struct PointMotion {
  Vec3<Real> velocity, displacement;
};

/// Takes one step of Verlet's method for a free phyxel.
/// @param acceleration by all forces [m/s²]. @param dt [s]. @param keep, gain damping factors
/// (`damped_flow`)
template <bool damped, class Real>
PHYXEL_HD PointMotion<Real> moved(PointMotion<Real> point, Vec3<Real> acceleration, Real dt,
                                  [[maybe_unused]] Real keep, [[maybe_unused]] Real gain) {
  if constexpr (damped) {
    point.velocity = verlet_velocity_damped(point.velocity, acceleration, keep, gain);
  } else {
    point.velocity = verlet_velocity(point.velocity, acceleration, dt);
  }
  point.displacement = fused(dt, point.velocity, point.displacement);
  return point;
}

}  // namespace phyxel
