/// The time loop, the step limit and the stability watch.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// How the largest stable step was found.
struct StepLimit {
  double omega_max = 0;     ///< Largest eigenfrequency of the model at rest [rad/s].
  double largest_step = 0;  ///< 2 / omega_max [s].
  double sound_step = 0;    ///< Smallest h / c, for comparison [s].
  int iterations = 0;       ///< Lanczos iterations taken.
};

/// Largest eigenvalue of M^-1 K at the reference state, by Lanczos iteration on the force
/// function itself (differenced at rest, in double), so that every term in use counts.
/// Damping included: the largest step is that of the damped central difference.
StepLimit step_limit(const Model& model);

/// The state at t = 0: displacements of motions, initial velocities of the bodies.
State initial_state(const Model& model, const Scene& scene, double dt);

/// Advances a state through a backend.
class Solver {
 public:
  Solver(const Model& model, Backend& backend, const State& start);

  void step();                       ///< One time step.
  double time() const { return static_cast<double>(steps_) * dt_; }
  std::int64_t steps() const { return steps_; }
  double dt() const { return dt_; }
  State state() const;               ///< Downloaded copy.
  Diagnostics diagnose();

 private:
  const Model& model_;
  Backend& backend_;
  std::int64_t steps_ = 0;
  double dt_ = 0;
};

}  // namespace phyxel
