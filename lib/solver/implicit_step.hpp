/// Implicit time integration, whose step the motions to be resolved limit rather than the
/// stiffness.
#pragma once

#include "solver/newton.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// The length of each of the two stages of an implicit step of `dt` [s].
double stage_of_step(double dt);

/// What slip is at the end of a stage of `span` [s]. Points that stick creep: their slip in a stage
/// is up to a thousandth of the depth to which the same pressure pushes them.
/// @param u,v displacements [m] and velocities [m/s] at the end of the stage
SlipMeasure slip_of_stage(double span, const std::vector<Vec3d>& u, const std::vector<Vec3d>& v);

/// Steps of the singly diagonal Runge–Kutta method of Alexander 1977 (Diagonally implicit
/// Runge–Kutta methods for stiff O.D.E.'s, equation for two stages): of second order and L-stable,
/// so that oscillations much faster than a step are damped out. Each of the two stages is a balance
/// of forces with inertia. Linear momentum is conserved to rounding.
class ImplicitStep {
 public:
  /// @param backend of the model, in double; both must outlive this
  ImplicitStep(const Model& model, Backend& backend);

  void observe(NewtonObserver observer) { newton_.observe(std::move(observer)); }

  /// Advances `state`, whose velocities belong to its time, by state.dt, and uploads it to the
  /// backend. Collective.
  /// @throws DivergedError if Newton's method does not find a balance, InterruptedError if the
  /// observer asks for it; `state` is then unchanged
  void take(State& state);

  /// Sums over all steps, and the largest residual.
  const NewtonReport& work() const { return work_; }
  /// All forces but those of supports [N] at the end of the last step, shape [n]; empty before the
  /// first step, and without supports.
  const std::vector<Vec3d>& end_force() const { return end_force_; }
  /// Work of supports and sums of obstacles, by the rule of `Solver::step_sums`, on the phyxels of
  /// this rank.
  const StepSums& step_sums() const { return support_work_; }
  /// What the obstacles would do in a second at the end of the last step, on the phyxels of this
  /// rank (`ContactTerms`); empty before the first step.
  std::span<const ExactSum> end_contact() const {
    if (end_contact_.empty()) return {};
    return std::span(end_contact_).subspan(sums_of_motions(model_));
  }

 private:
  using Vector = Newton::Vector;
  /// Takes a stage of length s [s] that ends at `time` [s].
  /// @param from U of the stage [m]. @param moving velocities before the stage, of the slips from
  /// which a search with friction starts [m/s]. @param u start of other searches; receives u' [m].
  /// @param v V of the stage; receives v' [m/s]
  /// @returns all forces but those of supports at u' [N]
  Vector take_stage(double time, double s, const Vector& from, const Vector& moving, Vector& u,
                    Vector& v);
  void take_both_stages(State& state);
  /// Adds the work of supports at an instant.
  void add_support_work(const SupportInstant& now);
  /// Adds the impulses and the work of contact over a time [s], with the forces at the end of a
  /// stage. @param v velocities there, of supports, too [m/s]
  void add_contact(const Vector& u, const Vector& v, double time, StepSums& sums) const;
  /// The mean velocities of supports over a step, zero along free axes [m/s].
  Vector path_velocities(std::int64_t step, double dt) const;

  const Model& model_;
  Backend& backend_;
  Newton newton_;
  Balance balance_;
  std::vector<double> damping_;  ///< Damping [1/s], shape [n]; empty if there is none.
  NewtonReport work_;
  Vector end_force_;
  StepSums support_work_;
  StepSums end_contact_;
};

}  // namespace phyxel
