/// Contact of a point with a rigid obstacle: impulses at predicted positions.
///
/// A step first moves all points as if nothing were in their way. Points that then lie inside an
/// obstacle are moved onto its surface, and their velocities change by as much over the step: the
/// force acts where the point would be, so that the stable step does not shrink, and nothing has to
/// be tuned. Friction is Coulomb's: a sticking point has its slip taken away in each step, so that
/// no spring has to be remembered, and a block rests on a slope for ever.
#pragma once

#include <cmath>

#include "phyxel/physics/obstacle.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// How two surfaces rub and bounce.
struct ContactLaw {
  double static_friction = 0;   ///< μ_s: largest tangential over normal force of a point at rest.
  double kinetic_friction = 0;  ///< μ_d: the same of a point that slides.
  /// Speed of a point of the surface after an impact over the one before; what a body as a whole
  /// returns comes from its elasticity.
  double restitution = 0;
};

/// A point of a body at the end of a step, before contact.
struct ContactPoint {
  Vec3<double>
      velocity;         ///< Relative to the obstacle's surface there, after all other forces [m/s].
  Vec3<double> before;  ///< Relative velocity at the start of the step [m/s].
  Vec3<double> free;    ///< 1 along axes on which the point is free, 0 along prescribed ones.
};

/// The force of contact on a point times the step over its mass [m/s]: the change of the point's
/// velocity along free axes, while supports bear what acts along the others.
struct ContactChange {
  Vec3<double> normal, tangential;
};

/// The components of a vector along the axes on which a point is free.
PHYXEL_HD Vec3<double> freed(const Vec3<double>& free, const Vec3<double>& v) {
  return {v.x * free.x, v.y * free.y, v.z * free.z};
}

/// How far a point gives way along prescribed axes in friction, over what it does along free ones.
/// No force stops a slip that supports impose: there friction is whole from a slip of a hundredth
/// of the one that it would stop on a free point. From less on, rounding would rub; from more on,
/// supports that move slowly would feel less than they should.
inline constexpr double give_of_prescribed = 0.01;

/// Coulomb's friction on a point, as of `ContactChange`: -v_t/|v_t| min(μ push, |v_t|/d), where
/// d = 1 for a slip along free axes, and `give_of_prescribed` for one along prescribed axes.
/// @param velocity v relative to the surface, after all other forces [m/s]
/// @param free as of `ContactPoint`. @param push the normal force, likewise [m/s]
PHYXEL_HD Vec3<double> friction_change(Vec3<double> velocity, Vec3<double> normal,
                                       const Vec3<double>& free, double push,
                                       const ContactLaw& law) {
  const Vec3<double> slip = velocity - dot(velocity, normal) * normal;
  const double square = dot(slip, slip), speed = std::sqrt(square);
  if (!(square > 0)) return {};
  const double movable = dot(freed(free, slip), slip) / square;
  const double whole = 1 / (movable + give_of_prescribed * (1 - movable));  // what stops it
  const double stop = whole * speed, hold = law.kinetic_friction * push;
  const bool sticks = stop <= law.static_friction * push || stop < hold;
  return -(sticks ? whole : hold / speed) * slip;
}

/// The force that brings a point at a distance g < 0 from an obstacle onto its surface at the end
/// of the step, as of `ContactChange`,
///
///   Δv_n = max(-g/Δt, -(1 + e) n · v⁻)/s n,   Δv_t = -v_t/|v_t| min(μ Δv_n, |v_t|),
///
/// where v⁻ is the relative velocity before the step, v_t the tangential one after all other
/// forces, and s = n · F n, with 1 in F along free axes and 0 along others, makes the free axes do
/// what prescribed ones cannot. Where n is almost along those, a step makes good a part of the gap
/// alone, since the free axes would have to move by far more than the gap.
/// @param gap with a negative distance. @param dt size of the step [s]
PHYXEL_HD ContactChange contact_change(const Gap& gap, const ContactPoint& point,
                                       const ContactLaw& law, double dt) {
  const Vec3<double> n = gap.normal, way = freed(point.free, n);
  const double share = dot(way, n);  // of the obstacle's push that the free axes feel
  if (!(share > 1e-6)) return {};
  double rate = -gap.distance / dt;
  const double approach = -dot(n, point.before);
  if (law.restitution > 0 && approach > 0) {
    const double rebound = (1 + law.restitution) * approach;
    rate = rate < rebound ? rebound : rate;
  }
  constexpr double least = 0.1;
  const double push = rate / (share > least ? share : least);  // force times Δt/m
  ContactChange change{push * n, {}};
  if (!(law.static_friction > 0)) return change;
  change.tangential = friction_change(point.velocity + push * way, n, point.free, push, law);
  return change;
}

/// Where an obstacle is at the end of a step, and how it has moved, in double: what a kernel knows
/// of it. A point y of the shape's own coordinates is at p = turn_at_rest y + place_at_rest at
/// rest, and at turn y + place at the end of the step.
struct ObstacleStep {
  Mat3<double> turn;   ///< At the end of the step.
  Vec3<double> place;  ///< Likewise [m].
  Mat3<double> turn_at_rest;
  Vec3<double> place_at_rest;  ///< [m]
  /// Velocity of the obstacle over the step where a point p at rest is: velocity +
  /// slope (p - place_at_rest) [m/s].
  Vec3<double> velocity;
  Mat3<double> slope;  ///< [1/s]
  /// Velocity at the start of the step of a rigid rotation about a centre [m/s], its antisymmetric
  /// gradient [1/s], and that centre at the end of the step [m]: a point x then moves with
  /// drift + spin (x - centre), of which a surface of revolution about its axis sees nothing along
  /// its normals.
  Vec3<double> drift;
  Mat3<double> spin;
  Vec3<double> centre;
  bool hollow = false;  ///< True if points belong inside.
  ContactLaw law;
  double dt = 0;  ///< Size of the step [s].
};

/// The distance of a point from an obstacle of a shape, at the end of a step [m].
template <class Shape>
PHYXEL_HD Gap gap_to(const Shape& shape, const ObstacleStep& obstacle, Vec3<double> x) {
  Gap gap = shape.gap(transpose(obstacle.turn) * (x - obstacle.place));
  gap.normal = obstacle.turn * gap.normal;
  if (obstacle.hollow) gap = {-gap.distance, -gap.normal};
  return gap;
}

/// The velocity over a step of the point of an obstacle that is at x [m] at its end [m/s].
PHYXEL_HD Vec3<double> surface_velocity(const ObstacleStep& obstacle, Vec3<double> x) {
  // The place at rest of that point, from the obstacle's own.
  const Vec3<double> arm =
      obstacle.turn_at_rest * (transpose(obstacle.turn) * (x - obstacle.place));
  return obstacle.velocity + obstacle.slope * arm;
}

/// The velocity at the start of a step of the rigid motion of an obstacle, at a point x [m] at its
/// end [m/s].
PHYXEL_HD Vec3<double> rigid_velocity(const ObstacleStep& obstacle, Vec3<double> x) {
  return obstacle.drift + obstacle.spin * (x - obstacle.centre);
}

/// What contact with an obstacle adds to its sums over steps.
struct ContactTerms {
  /// Indices of the terms: impulse on the point [N s]; angular impulse about the obstacle's place
  /// at rest [N m s]; work of the obstacle on the point, heat of friction, loss in the impact [J].
  enum { impulse = 0, moment = 3, work = 6, friction_heat, impact_loss, count };
  double value[count] = {};

  /// The impulse on the point [N s].
  PHYXEL_HD Vec3<double> whole_impulse() const {
    return {value[impulse], value[impulse + 1], value[impulse + 2]};
  }
  /// Sets the terms of an impulse, `normal` and `tangential` [N s], on a point.
  /// @param arm from the obstacle's place at rest to where the impulse acts [m]
  /// @param surface,relative velocity of the obstacle's surface there, and that of the point
  /// relative to it, in the mean of the impulse's time [m/s]
  PHYXEL_HD void set(Vec3<double> normal, Vec3<double> tangential, Vec3<double> arm,
                     Vec3<double> surface, Vec3<double> relative) {
    const Vec3<double> all = normal + tangential, turning = cross(arm, all);
    const double terms[] = {all.x,
                            all.y,
                            all.z,
                            turning.x,
                            turning.y,
                            turning.z,
                            dot(all, surface),
                            -dot(tangential, relative),
                            -dot(normal, relative)};
    for (int k = 0; k < count; ++k) value[k] = terms[k];
  }
};

/// A point that may touch an obstacle, at the end of a step.
struct TouchingPoint {
  Vec3<double> position;  ///< At the end of the step [m].
  Vec3<double> velocity;  ///< Over the step [m/s].
  Vec3<double> before;    ///< Velocity at the start of the step [m/s].
  Vec3<double> free;      ///< As of `ContactPoint`.
  double offset = 0;      ///< Its distance from its body's surface [m].
  double inertia = 0;     ///< Mass over the gain of the step (`DampedFlow`) [kg/s].
};

/// Keeps a point out of an obstacle: changes its velocity and position, and returns true, if it
/// would be inside.
/// @param terms receives what is added to the obstacle's sums
template <class Shape>
PHYXEL_HD bool touch(const Shape& shape, const ObstacleStep& obstacle, TouchingPoint& point,
                     ContactTerms& terms) {
  Gap gap = gap_to(shape, obstacle, point.position);
  gap.distance -= point.offset;
  if (!(gap.distance < 0)) return false;
  const Vec3<double> surface = surface_velocity(obstacle, point.position);
  const Vec3<double> mean = rigid_velocity(obstacle, point.position);
  const ContactChange change = contact_change(
      gap, {point.velocity - surface, point.before - mean, point.free}, obstacle.law, obstacle.dt);
  const Vec3<double> all = freed(point.free, change.normal + change.tangential);
  const Vec3<double> start = point.position - obstacle.dt * point.velocity;
  point.velocity += all;
  point.position += obstacle.dt * all;
  const double mass = point.inertia * obstacle.dt;
  terms.set(mass * change.normal, mass * change.tangential, start - obstacle.place_at_rest, mean,
            0.5 * (point.before + point.velocity) - mean);
  return true;
}

}  // namespace phyxel
