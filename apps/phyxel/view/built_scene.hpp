/// A scene's model with its backend and solver.
#pragma once

#include <memory>
#include <optional>

#include "phyxel/diagnostics.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/shared_model.hpp"
#include "phyxel/solver.hpp"
#include "phyxel/step_control.hpp"

namespace phyxel::app {

/// The model of a scene, the backend and the solver that step it, and the watches over its steps.
/// Another value of the scene, such as of gravity, needs another one. Functions are collective.
struct BuiltScene {
  /// Makes the backend, and plans the steps. @throws InputError, DeviceError
  BuiltScene(std::unique_ptr<const SharedModel> model, const Scene& scene, bool unsafe_step);

  /// The model that this rank steps.
  const Model& model() const { return shared->here(); }
  /// Begins to step from a state; the energy is watched from there, unless external forces act.
  /// @returns its energies
  Diagnostics begin(const State& state, Method method);
  /// Finds energies and momenta, and checks the state. @throws DivergedError
  Diagnostics look();

  std::unique_ptr<const SharedModel> shared;
  std::unique_ptr<Backend> backend;
  StepPlan plan;
  std::optional<Solver> solver;
  std::optional<StepControl> control;
  std::optional<StabilityWatch> watch;  ///< Unset while forces of unknown work act.
};

}  // namespace phyxel::app
