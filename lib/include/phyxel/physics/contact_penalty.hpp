/// Contact as the derivative of an energy: a penalty on depth, of Newton's method and of Verlet's
/// steps that keep that energy.
///
/// A step of leapfrog changes velocities by the forces where it starts. The penalty acts there, and
/// friction where the step ends, as without a penalty: a point that sticks has its slip taken away.
#pragma once

#include "phyxel/physics/body_contact.hpp"
#include "phyxel/physics/contact.hpp"

namespace phyxel {

/// Force and stiffness of contact at a point, and their energy.
struct PenaltyForce {
  Vec3<double> force;        ///< On the point [N].
  Mat3<double> stiffness{};  ///< Minus its derivative, for a fixed normal [N/m].
  double energy = 0;         ///< [J]
};

/// The force on a point at a distance g < 0 from an obstacle: minus the derivative of ½ k g².
/// @param stiffness k [N/m]
PHYXEL_HD PenaltyForce penalty_force(const Gap& gap, double stiffness) {
  return {(-stiffness * gap.distance) * gap.normal, stiffness * outer(gap.normal, gap.normal),
          0.5 * stiffness * gap.distance * gap.distance};
}

/// The harmonic mean of two numbers.
PHYXEL_HD double harmonic_mean(double a, double b) { return 2 * a * b / (a + b); }

/// The stiffness of the penalty between a point and the surface of a body [N/m],
/// share M a/h with the harmonic mean M of the moduli on both sides.
/// @param of_point,of_surface moduli of pressure waves [Pa]
PHYXEL_HD double surface_stiffness(double share, double of_point, double of_surface,
                                   const SurfaceSite& site) {
  return share * harmonic_mean(of_point, of_surface) * site.area / site.range;
}

/// A point at the start of a step that penalties may push.
struct PushedPoint {
  Vec3<double> position;  ///< [m]
  Vec3<double> free;      ///< As of `ContactPoint`.
  double offset = 0;      ///< As of `TouchingPoint` [m].
  double stiffness = 0;   ///< k [N/m]
  double inertia = 0;     ///< Force over the change of velocity that the step starts with [kg/s].
};

/// Finds the change of the velocity with which a step starts by the penalty of an obstacle [m/s],
/// and returns true, if the point is inside.
/// @param obstacle where it is as the step starts
/// @param terms receives what is added to the obstacle's sums
template <class Shape>
PHYXEL_HD bool penalty_change(const Shape& shape, const ObstacleStep& obstacle,
                              const PushedPoint& point, Vec3<double>& change, ContactTerms& terms) {
  Gap gap = gap_to(shape, obstacle, point.position);
  gap.distance -= point.offset;
  if (!(gap.distance < 0)) return false;
  const Vec3<double> force = penalty_force(gap, point.stiffness).force;
  terms.set(obstacle.dt * force, {}, point.position - obstacle.place_at_rest,
            rigid_velocity(obstacle, point.position), {});
  change = (1 / point.inertia) * freed(point.free, force);
  return true;
}

/// Lets a point at the end of a step rub on an obstacle whose penalty pushes it: changes its
/// velocity and position, and returns true, if there is friction.
/// @param stiffness k [N/m]. @param terms receives what is added to the obstacle's sums
template <class Shape>
PHYXEL_HD bool rub(const Shape& shape, const ObstacleStep& obstacle, double stiffness,
                   TouchingPoint& point, ContactTerms& terms) {
  Gap gap = gap_to(shape, obstacle, point.position);
  gap.distance -= point.offset;
  if (!(gap.distance < 0)) return false;
  const Vec3<double> surface = surface_velocity(obstacle, point.position);
  const Vec3<double> mean = rigid_velocity(obstacle, point.position);
  const double push = -stiffness * gap.distance / point.inertia;
  const Vec3<double> change =
      friction_change(point.velocity - surface, gap.normal, point.free, push, obstacle.law);
  const Vec3<double> start = point.position - obstacle.dt * point.velocity;
  const Vec3<double> all = freed(point.free, change);
  point.velocity += all;
  point.position += obstacle.dt * all;
  terms.set({}, point.inertia * obstacle.dt * change, start - obstacle.place_at_rest, mean,
            0.5 * (point.before + point.velocity) - mean);
  return true;
}

}  // namespace phyxel
