/// The time loop and the step limit.
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "phyxel/backend.hpp"
#include "phyxel/equilibrium.hpp"
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

/// The limit at the displacements that the backend holds, and holds again after, within 2%: by
/// Lanczos iteration on differences of the forces there. `sound_step`, which is of the model at
/// rest, is not found. Of a share: collective, and the same on any number of ranks.
/// @returns a largest step that is infinite where nothing resists, NaN where a force is not finite
StepLimit present_step_limit(const Model& model, Backend& backend);

/// The steps a scene is taken in, and why.
struct StepPlan {
  StepLimit limit;                   ///< Of Verlet's steps.
  double dt = 0;                     ///< [s]
  std::int64_t steps = 0;            ///< To the end of the run.
  std::int64_t steps_per_frame = 0;  ///< Frames fall on multiples of it.
  std::string why;                   ///< One line for the summary.
  bool shortens = false;  ///< Whether steps are halved where a law stiffens (`StepShortener`).
  int halvings = 0;       ///< Of the step, so far.

  /// Halves the step so many times; frames and the end stay where they are.
  void halve(int times);
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
/// restarted run sees the same times to the bit; `halve_step` doubles the number of steps taken.
class Solver {
 public:
  /// By Verlet's steps. Uploads `start`, whose `dt` is the step size.
  Solver(Backend& backend, const State& start);
  /// By the method asked for. One step of the method `equilibrium` finds where the model comes to
  /// rest.
  /// @param backend in double, for another method than Verlet's
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
  /// two, and velocities move from t - dt/2 to t - dt/4 by the present forces. Exact in powers of
  /// two, so that times after a restart are the same bits. Of a share: collective.
  /// @throws InputError from a solver that was made without a model, or for another method
  void halve_step();
  double time() const { return static_cast<double>(steps_) * dt_; }  ///< [s]
  /// Taken since t = 0.
  std::int64_t steps() const { return steps_; }
  double dt() const { return dt_; }  ///< [s]
  /// What a `StepShortener` has found.
  Looks& looks() { return looks_; }
  /// When the present state is, for `diagnose`.
  Instant now() const;
  State state() const;  ///< Downloaded copy.
  /// Since this solver began.
  SolverWork work() const;

 private:
  void step_by_newton();

  const Model* model_ = nullptr;  ///< Of a method that needs it.
  Backend& backend_;
  Method method_ = Method::verlet;
  std::int64_t steps_, first_step_;
  double dt_;
  Looks looks_;
  std::unique_ptr<ImplicitStep> implicit_;
  State implicit_state_;
  NewtonObserver observer_;
  bool begun_ = false;  ///< The start is that of an interrupted search for rest.
  SolverWork rest_;     ///< Of the search for rest.
};

/// Halves Verlet's steps where laws have become so stiff that they would soon be unstable. It looks
/// at a bound that costs little, a wave in the stiffest phyxel; only beyond that bound it finds the
/// limit itself, as far fewer bodies outgrow their step than have a phyxel that would. When it
/// looks follows from what it has seen: often where a body stiffens, seldom where nothing changes.
/// All of that is part of the state, so that runs, restarts and any number of threads and ranks
/// halve at the same steps. Laws that cannot stiffen cost nothing.
class StepShortener {
 public:
  static constexpr int most_halvings = 10;  ///< Of one run.
  /// Of (dt / limit)²: bodies that stiffen fast come to half as much again between two looks.
  static constexpr double largest_share = 0.75;

  /// All must outlive this.
  StepShortener(const Model& model, Backend& backend, const StepPlan& plan);

  /// Before a step: if a look is due, looks, and halves the solver's step as often as needed.
  /// Collective.
  /// @param halvings made before
  /// @returns those made now
  /// @throws DivergedError, saying which phyxel, its stretch and when, if `most_halvings` are not
  ///   enough or a displacement is not finite
  int look(Solver& solver, int halvings);
  /// The step before which `look` has to be called next.
  std::int64_t next_look(Solver& solver) const {
    return active_ ? solver.looks().next : std::numeric_limits<std::int64_t>::max();
  }
  /// Whether any law can stiffen.
  bool active() const { return active_; }
  /// The fewest steps between two looks: half the number of steps in which a wave crosses the
  /// smallest body, from 1 to 16.
  std::int64_t fewest() const { return fewest_; }
  /// The most steps between two looks.
  std::int64_t most() const { return std::min<std::int64_t>(32 * fewest_, 128); }
  /// Looks without halving, so that messages know of models that cannot stiffen, too. Collective.
  void see(const Solver& solver);
  /// The first phyxel for which steps were halved, or else the stiffest of the last look: which,
  /// its stretch, and when. Collective.
  std::string where_it_began() const;

 private:
  /// (dt / limit)² at the present displacements.
  double share_of_limit(const Solver& solver) const;
  /// The largest share that is allowed: `largest_share`, or a tenth more than at rest where a scene
  /// asks for longer steps.
  double allowed_share(double dt) const;
  /// When to look again, after a look that found `ratio`.
  void look_again(const Solver& solver, Looks& looks, double ratio) const;

  static constexpr std::int64_t most_of_fewest = 16;
  struct Seen {
    Stiffening what;
    double time = 0;  ///< [s]
  };
  const Model& model_;
  Backend& backend_;
  double limit_;
  bool active_ = false;
  std::int64_t fewest_ = most_of_fewest;
  std::optional<Seen> seen_, first_;
};

}  // namespace phyxel
