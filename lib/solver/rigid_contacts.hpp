/// Contact of free rigid bodies with each other and with the other obstacles.
#pragma once

#include <span>
#include <vector>

#include "model/rigid_tips.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// The state of a free body after a step of `dt` [s] in which no force acts on it.
RigidState drifted(const RigidMass& mass, const RigidState& state, double dt);

/// The kinetic energy of a free body [J].
double kinetic_energy(const RigidMass& mass, const RigidState& state);

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

 private:
  /// A place where two bodies touch. Impulses on the first one act back on the second one.
  struct Touch {
    int first = -1, second = -1;  // numbers of free bodies; -1: an obstacle that is none
    Vec3d arm, other_arm;         // from their centres, as the step starts [m]
    Vec3d normal;                 // towards the first
    Vec3d given;                  // relative velocity of the first that paths set, not impulses
    Vec3d a, b;                   // unit vectors across the normal
    double target = 0;            // velocity along the normal that the step shall end with [m/s]
    ContactLaw law;
    double mobility = 0;                      // along the normal [m/s / (N s)]
    double mobility_across = 0;               // the largest one across it
    double push = 0, hold_a = 0, hold_b = 0;  // impulses so far [N s]
  };
  using Placed = RigidTips::Placed;
  void find_touches(double time, double dt, std::span<const RigidState> start,
                    std::span<const RigidState> states);
  /// Adds the touch of a tip that ends the step at a place, at a gap from another body [m].
  void add_touch(const Placed& of_tips, const Placed& other, Vec3d end, const Gap& gap, double dt,
                 std::span<const RigidState> start, std::span<const RigidState> states);
  /// The motion of a free body, which sweeps read and change.
  struct Moving {
    Vec3d velocity, spin;
    double inverse_mass = 0;
    Sym3d inverse_inertia;
  };
  void sweep_all(double speed, std::vector<Moving>& moving);

  const Model& model_;
  std::vector<std::size_t> free_;  // obstacles that are free bodies
  RigidTips tips_;
  std::vector<Touch> touches_;
};

}  // namespace phyxel
