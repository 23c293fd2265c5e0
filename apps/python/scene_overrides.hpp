/// Values that Python's caller sets in place of those of a scene.
#pragma once

#include <optional>
#include <string>

#include "phyxel/scene.hpp"

namespace phyxel::python {

/// Arguments of Python's `Simulation`; an argument that is not given keeps the scene's value.
struct SceneOverrides {
  std::optional<std::string> device, precision, method;
  std::optional<int> threads;
  std::optional<double> step, end;  ///< [s]
  bool unsafe_step = false;         ///< The scene has no such key: `plan_steps` takes it.
};

/// A time must be positive and finite. @param value [s] @throws InputError naming the argument
void check_positive(const char* name, double value);

/// The scene with the overrides in place. The methods other than Verlet's run in double precision.
/// @throws InputError naming the argument that has a wrong value or contradicts another
Scene with_overrides(Scene scene, const SceneOverrides& overrides);

}  // namespace phyxel::python
