/// The update of one phyxel in a step: from the sums over its neighbours to its pair stress, and
/// from its force to its displacement. Devices share this code and supply only neighbours and
/// storage.
#pragma once

#include "phyxel/physics/closing.hpp"
#include "phyxel/physics/force.hpp"
#include "phyxel/physics/hourglass.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Sums of the first pass over the neighbours of a phyxel.
template <class Real>
struct NeighbourSums {
  Mat3<Real> gradient;  ///< Σ_j w_ij u_ij x_ijᵀ (`add_gradient_term`).
  Vec3<Real> pull;      ///< Σ_j w_ij u_ij (`add_pull`); zero unless a term needs it.

  /// Adds a neighbour. @tparam pulls true if a term needs `pull`
  template <bool pulls>
  PHYXEL_HD void add(Vec3<Real> x_ij, Vec3<Real> u_ij, Real w_ij) {
    add_gradient_term(gradient, u_ij, w_ij * x_ij);
    if constexpr (pulls) add_pull(pull, u_ij, w_ij);
  }
};

/// Constants of a phyxel that its stress depends on.
template <class Real>
struct PointConstants {
  Real volume;                            ///< v [m³]
  Sym3<Real> inverse_moment;              ///< A⁻¹ [1/m²]
  Real hourglass{};                       ///< κ [N/m] of hourglass control.
  Vec3<Real> moment_offset{}, closing{};  ///< b [m] and ĉ [1/m] of closed gradients.
};

/// Stresses of a phyxel, from which the second pass computes forces on it and its neighbours.
template <class Real>
struct PointStress {
  Mat3<Real> pair_stress;      ///< Q [N/m]
  Vec3<Real> hourglass_force;  ///< Own force of hourglass control [N].
  Vec3<Real> closing_stress;   ///< t [N] of closed gradients.
};

/// The displacement gradient ∇u from which the stress of a phyxel is computed.
/// @param fit the linear fit of its neighbours' displacements
template <bool closed, class Real>
PHYXEL_HD Mat3<Real> seen_gradient(const Mat3<Real>& fit, Vec3<Real> pull,
                                   const PointConstants<Real>& point) {
  if constexpr (closed) {
    return closed_gradient(fit, pull, point.moment_offset, point.closing);
  } else {
    return fit;
  }
}

/// The pair stress and the closing stress of a phyxel without hourglass control.
/// @param stress P [Pa]. @tparam closed true with closed gradients
template <bool closed, class Real>
PHYXEL_HD PointStress<Real> elastic_point_stress(const Mat3<Real>& stress,
                                                 const PointConstants<Real>& point) {
  PointStress<Real> result;
  result.pair_stress = pair_stress(point.volume, stress, point.inverse_moment);
  if constexpr (closed) {
    result.closing_stress = closing_stress(point.volume, stress, point.closing);
    result.pair_stress = closed_pair_stress(result.pair_stress, result.closing_stress,
                                            point.moment_offset, point.inverse_moment);
  }
  return result;
}

/// The stress of a phyxel.
/// @tparam controlled true with hourglass control. @tparam closed true with closed gradients
/// @param stress_of function that returns P [Pa] of ∇u by the law and its history
template <bool controlled, bool closed, class Real, class StressOf>
PHYXEL_HD PointStress<Real> point_stress(const NeighbourSums<Real>& sums,
                                         const PointConstants<Real>& point, StressOf&& stress_of) {
  const Mat3<Real> fit = displacement_gradient(sums.gradient, point.inverse_moment);
  const Mat3<Real> stress = stress_of(seen_gradient<closed>(fit, sums.pull, point));
  PointStress<Real> result = elastic_point_stress<closed>(stress, point);
  if constexpr (controlled) {
    result.pair_stress = with_hourglass(result.pair_stress, point.hourglass, fit);
    result.hourglass_force = pull_force(point.hourglass, sums.pull);
  }
  return result;
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
