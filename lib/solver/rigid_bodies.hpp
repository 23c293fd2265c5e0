/// The free rigid bodies of a model in steps of Verlet's method.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/state.hpp"
#include "solver/rigid_contacts.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// Moves free bodies step by step. A step adds gravity to their velocities, keeps them out of each
/// other, of other obstacles and of held points, and moves them; then phyxels are kept out of them,
/// as out of obstacles on a path, and the impulses of that act back on them in the next step. So
/// phyxels stick to them as to an obstacle at rest, and both momenta of all bodies are kept to
/// rounding. All ranks do the same.
class RigidBodies {
 public:
  /// @param model must outlive this
  explicit RigidBodies(const Model& model);

  /// True in scenes without free bodies.
  bool empty() const { return bodies_.empty(); }
  /// Sets the states. @param states none: as they start. @param dt size of the step [s]
  /// @throws InputError for another number of states than of free bodies
  void put(std::span<const RigidState> states, double dt);
  const std::vector<RigidState>& states() const { return states_; }

  /// The state that a step changes.
  struct Kept {
    std::vector<RigidState> states;
    StepSums earlier, of_held_points;
  };
  Kept kept() const { return {states_, earlier_, of_held_points_}; }
  /// Returns to a kept state.
  void put_back(Kept kept) {
    states_ = std::move(kept.states);
    earlier_ = std::move(kept.earlier);
    of_held_points_ = std::move(kept.of_held_points);
  }

  /// Moves the bodies over the step from `time` [s].
  void begin_step(double time, double dt);
  /// Where an obstacle that is a free body is at the end of the step, and how it moves.
  const ObstacleStep& step_of(std::size_t obstacle) const { return steps_[number_[obstacle]]; }
  /// Where an obstacle that is a free body is before a step of `dt` [s], and how it moves.
  ObstacleStep start_of(std::size_t obstacle, double dt) const {
    ObstacleStep step = model_.obstacles[obstacle].placed(states_[number_[obstacle]]);
    step.dt = dt;  // for which forces act on it
    return step;
  }
  /// Lets what obstacles have done to phyxels since the last call act back. Of a share: collective.
  /// @param sums of all obstacles and steps so far, of this rank (`ContactTerms`)
  void act_back(std::span<const ExactSum> sums);
  /// Adds the impulses of free bodies on held points to sums of all obstacles (`ContactTerms`).
  StepSums with_held_points(StepSums sums) const;
  /// The impulses on held points of the last `begin_step`.
  const std::vector<HeldImpulse>& on_held_points() const { return contacts_.on_held(); }

 private:
  const Model& model_;
  std::vector<std::size_t> bodies_;  // obstacles that are free bodies
  std::vector<std::size_t> number_;  // of each obstacle among these
  std::vector<RigidState> states_;
  std::vector<ObstacleStep> steps_;  // of the present step
  StepSums earlier_;                 // impulses and angular impulses at the last call of `act_back`
  StepSums of_held_points_;          // so far, of all obstacles; on the first of several ranks
  RigidContacts contacts_;
};

/// Adds the energies and momenta of free bodies to those of the phyxels.
/// @param lag time from the velocities of the states to their places [s]
void add_rigid(const Model& model, std::span<const RigidState> states, double lag,
               Diagnostics& sums);

}  // namespace phyxel
