/// Contact of free rigid bodies with each other and with obstacles that nothing moves but their
/// paths.
#pragma once

#include <span>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// The state of a free body after a step of `dt` [s] in which no force acts on it.
RigidState drifted(const RigidMass& mass, const RigidState& state, double dt);

/// The kinetic energy of a free body [J].
double kinetic_energy(const RigidMass& mass, const RigidState& state);

/// Finds where free bodies touch, and the impulses that keep them apart, with Coulomb's friction
/// and restitution: those of all places together, by repeated sweeps, so that what rests does not
/// creep. Nothing is remembered from step to step.
class RigidContacts {
 public:
  /// @param model must outlive this
  explicit RigidContacts(const Model& model);

  /// Adds the impulses of a step to the velocities and angular momenta of the free bodies.
  /// @param start the states with which the step from `time` [s] starts
  /// @param states the same, with all other forces of the step in their velocities
  void resolve(double time, double dt, std::span<const RigidState> start,
               std::vector<RigidState>& states);

  /// The two obstacles that overlap most at the start, one of them free, and how deep [m]; 0: none.
  struct Overlap {
    std::size_t first = 0, second = 0;
    double depth = 0;
  };
  Overlap overlap_at_start();

 private:
  /// A place where two bodies touch. Impulses on the first one act back on the second one.
  struct Touch {
    int first = -1, second = -1;  // numbers of free bodies; -1: an obstacle that is none
    Vec3d arm, other_arm;         // from their centres, as the step starts [m]
    Vec3d normal;                 // towards the first
    Vec3d given;        // velocity of the first relative to the second as far as paths set it
    Vec3d a, b;         // unit vectors across the normal
    double target = 0;  // velocity along the normal that the step shall end with [m/s]
    ContactLaw law;
    double mobility = 0;                      // along the normal [m/s / (N s)]
    double mobility_across = 0;               // the largest one across it
    double push = 0, hold_a = 0, hold_b = 0;  // impulses so far [N s]
  };
  /// A body where the step leads it: a free one (its number), or another obstacle (-1).
  struct Placed {
    std::size_t obstacle = 0;
    int free = -1;
    ObstacleStep step;
    Vec3d centre;       // of the ball around its tips, there [m]
    double reach = -1;  // radius of that ball [m]; negative: it has no tips
  };
  /// Calls each(a, b) for the pairs in which the tips of a may be inside b.
  template <class Each>
  void for_each_pair(Each&& each) const;
  /// Calls each(x, gap) for the tips of one body inside the other: x is where they are [m].
  template <class Each>
  void for_each_inside(const Placed& of_tips, const Placed& other, Each&& each) const;
  void place_all(double time, double dt, std::span<const RigidState> states);
  void find_touches(double dt, std::span<const RigidState> start,
                    std::span<const RigidState> states);
  void add_touches(const Placed& of_tips, const Placed& other, double dt,
                   std::span<const RigidState> start, std::span<const RigidState> states);
  /// The motion of all that one sweep reads and changes.
  struct Moving {
    Vec3d velocity, spin;
    double inverse_mass = 0;
    Mat3d inverse_inertia;
  };
  void sweep_all(double speed, std::vector<Moving>& moving);

  const Model& model_;
  std::vector<std::size_t> free_;         // obstacles that are free bodies
  std::vector<std::vector<Vec3d>> tips_;  // of each obstacle, in its own coordinates [m]
  std::vector<double> radius_;            // of the tips of each obstacle [m]
  std::vector<Vec3d> middle_;             // of the ball around them, likewise [m]
  std::vector<double> reach_;             // radius of that ball [m]; negative: no tips
  std::vector<Placed> placed_;            // of each obstacle
  std::vector<Touch> touches_;
};

}  // namespace phyxel
