/// Contact of free rigid bodies with each other, with the other obstacles, and with held points.
#pragma once

#include <span>
#include <vector>

#include "model/rigid_tips.hpp"
#include "phyxel/model.hpp"
#include "solver/held_points.hpp"

namespace phyxel {

/// The state of a free body after a step of `dt` [s] in which no force acts on it.
RigidState drifted(const RigidMass& mass, const RigidState& state, double dt);

/// The kinetic energy of a free body [J].
double kinetic_energy(const RigidMass& mass, const RigidState& state);

/// The impulse of a free body on a held point in a step, which the point's support bears.
struct HeldImpulse {
  Index id = 0;              ///< Of the point.
  std::size_t obstacle = 0;  ///< Number of the free body among the obstacles.
  ContactTerms terms;        ///< Additions to the obstacle's sums.
};

/// Finds the places where free bodies touch, and the impulses that keep them apart, with Coulomb's
/// friction and restitution. Repeated sweeps find the impulses of all places together, so that a
/// body at rest does not creep. No impulse is remembered from step to step.
class RigidContacts {
 public:
  /// @param model must outlive this
  explicit RigidContacts(const Model& model);

  /// Adds the impulses of a step to the velocities and angular momenta of the free bodies.
  /// @param start the states with which the step from `time` [s] starts
  /// @param states the same, with all other forces of the step in their velocities
  void resolve(double time, double dt, std::span<const RigidState> start,
               std::vector<RigidState>& states);
  /// The impulses of the last step on held points.
  const std::vector<HeldImpulse>& on_held() const { return on_held_; }

 private:
  /// A place where two bodies touch. Impulses on the first one act back on the second one.
  struct Touch {
    int first = -1, second = -1;  // numbers of free bodies; -1: something that impulses do not move
    Index held = -1;              // id of the held point that the first one is; -1: it is none
    Vec3d arm, other_arm;         // from their centres, as the step starts [m]
    Vec3d normal;                 // towards the first
    Vec3d given;                  // relative velocity of the first that paths set, not impulses
    Vec3d a, b;                   // unit vectors across the normal
    double target = 0;            // velocity along the normal that the step shall end with [m/s]
    ContactLaw law;
    double mobility = 0;                      // along the normal [m/s / (N s)]
    double mobility_across = 0;               // the largest one across it
    double push = 0, hold_a = 0, hold_b = 0;  // impulses so far [N s]
    Vec3d normal_impulse() const { return push * normal; }
    Vec3d tangential_impulse() const { return hold_a * a + hold_b * b; }
    Vec3d impulse() const { return normal_impulse() + tangential_impulse(); }
  };
  using Placed = RigidTips::Placed;
  void find_touches(double time, double dt, std::span<const RigidState> start,
                    std::span<const RigidState> states);
  /// One of two things that touch.
  struct Side {
    int free = -1;          // number of a free body; -1: it moves on a path
    Vec3d velocity, start;  // of a path, over the step and as it starts [m/s]
  };
  static Side side_of(const Placed& body, Vec3d end);
  /// Adds a touch at a place at the end of the step, with the gap of the first one from the second
  /// one.
  Touch& add_touch(const Side& first, const Side& second, const ContactLaw& law, Vec3d end,
                   const Gap& gap, double dt, std::span<const RigidState> start,
                   std::span<const RigidState> states);
  /// The motion of a free body, which sweeps read and change.
  struct Moving {
    Vec3d velocity, spin;
    double inverse_mass = 0;
    Sym3d inverse_inertia;
  };
  /// Finds how velocities at touches answer to impulses. @returns the speed by which changes count
  /// as small [m/s]
  double find_mobilities(const std::vector<Moving>& moving);
  void sweep_all(double speed, std::vector<Moving>& moving);
  /// Adds the impulses of all touches to the states.
  void add_impulses(std::vector<RigidState>& states) const;
  /// Adds what touches lose: impulses times mean relative velocities over the step, which is
  /// nothing where bodies rest on each other. Of a held point the loss is among the terms of its
  /// impulse.
  void add_losses(std::span<const RigidState> start, std::vector<RigidState>& states);

  const Model& model_;
  std::vector<std::size_t> free_;  // obstacles that are free bodies
  RigidTips tips_;
  PlacedHeldPoints held_;
  std::vector<Touch> touches_;
  std::vector<HeldImpulse> on_held_;
};

}  // namespace phyxel
