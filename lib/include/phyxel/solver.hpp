/// The time loop and the step limit.
#pragma once

#include <memory>
#include <string>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// How the largest stable step was found.
struct StepLimit {
  double omega_max = 0;     ///< Largest eigenfrequency of the model at rest [rad/s].
  double largest_step = 0;  ///< 2 / omega_max [s]: Verlet is stable below it.
  double sound_step = 0;    ///< Smallest h / c over the phyxels [s], for comparison.
  int iterations = 0;       ///< Lanczos iterations taken.
};

/// Largest eigenvalue of M⁻¹K at the reference state, by Lanczos iteration on the force function
/// itself, so that every term in use counts. Fixed phyxels are taken as free, which can only lower
/// the limit, and damping is left out, which raises it (`verlet_velocity_damped`). On the CPU, in
/// double.
/// @throws InputError if nothing in the model resists deformation.
StepLimit step_limit(const Model& model, int threads = 0);

/// The same on the backend's device, in its working precision: equal to the limit found on the CPU
/// to rounding. It uses the backend's arrays: a state is to be uploaded after.
StepLimit step_limit(const Model& model, Backend& backend);

/// The steps a scene is taken in, and why.
struct StepPlan {
  StepLimit limit;                   ///< Of Verlet's steps.
  double dt = 0;                     ///< [s]
  std::int64_t steps = 0;            ///< To the end of the run.
  std::int64_t steps_per_frame = 0;  ///< Frames fall on multiples of it.
  std::string why;                   ///< One line for the summary.
};

/// Chooses the step: the scene's, or the safety factor times the largest stable one, of which three
/// digits are kept; slightly shortened so that frames and the end fall on whole steps. A step that
/// the scene leaves open is at most a twentieth of every period, duration, turn and ramp of the
/// scene's motions and loads, and 0.5 / c under damping c, where distances are 1% off. A search for
/// equilibrium is one step. Uses the arrays of the backend.
/// @throws InputError for a step above the largest stable one or above 1 / c unless `unsafe_step`,
///   for one that leaves a motion or a ramp fewer than twenty steps, for implicit steps of no given
///   size, and for more steps than can be counted.
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

class ImplicitStep;

/// Advances a state through a backend by steps of fixed size. Time is always step × dt, so that a
/// restarted run sees the same times to the bit.
class Solver {
 public:
  /// By Verlet's steps. Uploads `start`, whose `dt` is the step size.
  Solver(Backend& backend, const State& start);
  /// By the method asked for. One step of the method `equilibrium` finds where the model comes to
  /// rest.
  /// @param backend in double, for another method than Verlet's
  Solver(const Model& model, Backend& backend, const State& start, Method method);
  ~Solver();

  /// @throws DivergedError if Newton's method finds no balance
  void step();
  double time() const { return static_cast<double>(steps_) * dt_; }  ///< [s]
  /// Taken since t = 0.
  std::int64_t steps() const { return steps_; }
  double dt() const { return dt_; }  ///< [s]
  /// When the present state is, for `diagnose`.
  Instant now() const;
  State state() const;  ///< Downloaded copy.
  /// Since this solver began.
  SolverWork work() const;

 private:
  const Model* model_ = nullptr;  ///< Of a method that needs it.
  Backend& backend_;
  Method method_ = Method::verlet;
  std::int64_t steps_, first_step_;
  double dt_;
  std::unique_ptr<ImplicitStep> implicit_;
  State implicit_state_;
  SolverWork rest_;  ///< Of the search for rest.
};

}  // namespace phyxel
