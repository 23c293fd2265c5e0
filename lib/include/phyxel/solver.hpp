/// The time loop and the step limit.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// How the largest stable step was found.
struct StepLimit {
  double omega_max = 0;     ///< Largest eigenfrequency of the model at rest [rad/s].
  double largest_step = 0;  ///< `stable_step` of omega_max [s]: Verlet is stable below it.
  double sound_step = 0;    ///< Smallest h / c over the phyxels [s], for comparison.
  int iterations = 0;       ///< Lanczos iterations taken.
};

/// The share of 2/ω that Verlet's steps may have under Kelvin–Voigt damping, √(1 + ξ²) - ξ, where
/// the mode is damped by ξ = τω/2 of critical damping: viscous forces follow from half-step
/// velocities.
/// @param relaxation_time τ [s], at least 0. @param omega ω [rad/s]
double viscous_step_share(double relaxation_time, double omega);

/// The largest stable step [s] of Verlet's method for a mode of angular frequency ω [rad/s], 2/ω,
/// or `viscous_step_share` of that if a relaxation time τ [s] damps it.
double stable_step(double omega, double relaxation_time);

/// The longest relaxation time τ of all materials [s]. Of a share: collective.
double largest_viscosity(const Model& model);

/// Largest eigenvalue of M⁻¹K at the reference state, by Lanczos iteration on the force function
/// itself, so that every term in use counts. Fixed phyxels are taken as free, which can only lower
/// the limit, and damping in proportion to mass is left out, which raises it
/// (`verlet_velocity_damped`). The longest relaxation time of all bodies lowers it. On the CPU, in
/// double.
/// @throws InputError if nothing in the model resists deformation.
StepLimit step_limit(const Model& model, int threads = 0);

/// The same on the backend's device, in its working precision: equal to the limit found on the CPU
/// to rounding. It uses the backend's arrays: a state is to be uploaded after.
StepLimit step_limit(const Model& model, Backend& backend);

/// The limit at the displacements that the backend holds, and holds again after, within 2%: by
/// Lanczos iteration on differences of the elastic forces there; relaxation times are those at
/// rest. `sound_step`, which is of the model at rest, is not found. Of a share: collective, and the
/// same on any number of ranks.
/// @returns a largest step that is infinite where nothing resists, NaN where a force is not finite
StepLimit present_step_limit(const Model& model, Backend& backend);

/// The steps a scene is taken in, and why.
struct StepPlan {
  StepLimit limit;                   ///< Of Verlet's steps.
  double dt = 0;                     ///< [s]
  std::int64_t steps = 0;            ///< To the end of the run.
  std::int64_t steps_per_frame = 0;  ///< Frames fall on multiples of it.
  std::string why;                   ///< One line for the summary.
  bool shortens = false;   ///< True if steps are halved where a law stiffens (`StepControl`).
  bool lengthens = false;  ///< True if halved steps are doubled again where the limit allows it.
  int halvings = 0;        ///< The present step is the planned one, halved so many times.

  /// Halves the step `times` times, or doubles it -`times` times; frames and the end stay where
  /// they are. No step is longer than the planned one.
  void halve(int times);
};

/// Chooses the step: the scene's, or the safety factor times the largest stable one, of which three
/// digits are kept; slightly shortened so that frames and the end fall on whole steps. A step that
/// the scene leaves open is at most a twentieth of every period, duration, turn, ramp and rise
/// of a curve (`LoadCurve::shortest_rise`) of the scene's motions and loads, and 0.5 / c under
/// damping c, where distances are 1% off. A search for equilibrium is one step. Uses the arrays of
/// the backend.
/// @throws InputError for a step above the largest stable one or above 1 / c unless `unsafe_step`,
///   for one that leaves a motion, a ramp or a rise fewer than twenty steps, for implicit steps of
///   no given size, and for more steps than can be counted.
StepPlan plan_steps(const Scene& scene, const Model& model, Backend& backend,
                    bool unsafe_step = false);

/// The state at t = 0: initial velocities of the bodies, motions at their start, velocities as the
/// scene's method has them.
State initial_state(const Model& model, const Scene& scene, double dt);

/// What a solver has done so far.
struct SolverWork {
  std::int64_t evaluations = 0;  ///< Of the forces of all phyxels.
  std::int64_t newton_steps = 0;
  double residual = 0;  ///< Largest force that Newton's method has left, of what acts.
};

class ExactSum;
class ImplicitStep;

/// Advances a state through a backend by steps of fixed size. Time is always step × dt, so that a
/// restarted run sees the same times to the bit; `halve_step` doubles the number of steps taken,
/// and `double_step` halves it.
class Solver {
 public:
  /// By Verlet's steps. Uploads `start`, whose `dt` is the step size.
  Solver(Backend& backend, const State& start);
  /// By the method asked for. One step of the method `equilibrium` finds where the model comes to
  /// rest.
  /// @param backend in double, for another method than Verlet's
  /// @throws InputError for such a method and a backend in float or mixed
  Solver(const Model& model, Backend& backend, const State& start, Method method);
  ~Solver();

  /// Whom Newton's method tells how far it has come, and who may stop it; Verlet's steps ask
  /// nobody.
  void observe(NewtonObserver observer);

  /// Takes `count` steps. @param move_surfels whether surfels are brought along after each
  /// @throws DivergedError if Newton's method finds no balance; InterruptedError if the observer
  ///   stops it: the state is then that of the last whole step, or the last that a search for rest
  ///   has accepted, from which a solver that starts there goes on to the bit
  void step(std::int64_t count = 1, bool move_surfels = false);
  /// The number of steps to ask for at once: as many as the backend takes best, but not beyond step
  /// `limit`; at least 1.
  int steps_to(std::int64_t limit) const;
  /// Halves the step of Verlet's method: the present time stays, step and dt change by a factor of
  /// two, exactly, so that times after a restart are the same bits. Velocities move from t - dt/2
  /// to t - dt/4 by the present forces, and the state by what keeps the action of each mode
  /// (`StepChange`). Of a share: collective.
  /// @throws InputError from a solver that was made without a model, or for another method
  void halve_step();
  /// Doubles the step of Verlet's method, the inverse of `halve_step` but for higher orders of dt.
  /// Of a share: collective.
  /// @throws InputError after an odd number of steps, and as `halve_step`
  void double_step();
  double time() const { return static_cast<double>(steps_) * dt_; }  ///< [s]
  /// Taken since t = 0.
  std::int64_t steps() const { return steps_; }
  double dt() const { return dt_; }  ///< [s]
  /// The record of a `StepControl`.
  Looks& looks() { return looks_; }
  /// The same record, read-only.
  const Looks& looks() const { return looks_; }
  /// When the present state is, for `diagnose`.
  Instant now() const;
  /// A downloaded copy. Collective on a share whose supports move.
  State state() const;
  /// Since this solver began.
  SolverWork work() const;
  /// The method of its steps.
  Method method() const { return method_; }
  /// All forces but those of supports [N] at the end of the last implicit step, shape [n]; empty
  /// before the first one, for other methods, and without supports.
  std::span<const Vec3d> end_force() const;
  /// What the obstacles would do to the phyxels of this rank in a second at the end of the last
  /// implicit step, or where a search has found rest with friction, as exact sums (`ContactTerms`);
  /// empty before that, and for other methods.
  std::span<const ExactSum> end_contact() const;
  /// Forces of obstacles and bodies [N] where a search has found rest with friction, shape [n];
  /// empty before that, without friction, and for other methods.
  std::span<const Vec3d> rest_contact_force() const { return rest_contact_force_; }
  /// Sums over all steps since t = 0 and all ranks, as words of exact sums. First the work [J] that
  /// the support of each motion has done, shape [motions, words]; none if no support moves. Then
  /// what each obstacle has done (`ContactTerms`), shape [obstacles, 9, words]. Each step adds the
  /// reactions at its start, after Verlet's steps, or at its end, after implicit ones, times the
  /// mean of the displacements over the steps before and after: trapezoids, but for the last half
  /// (`find_reactions` completes them). A search for equilibrium adds nothing. Collective on a
  /// share, for a solver that was made with the model.
  std::vector<std::int64_t> step_sums() const;

 private:
  void step_by_newton();
  /// Goes on by steps of dt [s], of which the time so far is `steps`.
  void change_step(std::int64_t steps, double dt);
  /// Corrects the work of supports for a step that changes from `before` to `after` [s].
  void change_step_sums(double before, double after);

  const Model* model_ = nullptr;  ///< Of a method that needs it.
  Backend& backend_;
  Method method_ = Method::verlet;
  std::int64_t steps_, first_step_;
  double dt_;
  Looks looks_;
  std::unique_ptr<ImplicitStep> implicit_;
  State implicit_state_;
  NewtonObserver observer_;
  bool begun_ = false;                  ///< The start is that of an interrupted search for rest.
  SolverWork rest_;                     ///< Of the search for rest.
  std::vector<ExactSum> rest_contact_;  ///< Of `end_contact`, after a search for rest.
  std::vector<Vec3d> rest_contact_force_;
  // Work of supports, as words: that of the start, of all ranks; that of the backend before this
  // solver began; and corrections where the step changed, the last two of this rank.
  std::vector<std::int64_t> work_before_, work_of_backend_, work_of_changes_;
};

}  // namespace phyxel
