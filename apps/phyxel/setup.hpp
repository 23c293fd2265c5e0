/// What `run` and `check` share: a scene with the command line's overrides, and the plan it gives.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "phyxel/backend.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/solver.hpp"

namespace phyxel::app {

/// Options that replace what the scene says.
struct Overrides {
  std::string scene;
  std::string out, device, precision, method;
  std::optional<int> threads;
  std::optional<double> until, step;
  bool unsafe_step = false;
};
void add_overrides(CLI::App& command, Overrides& overrides);

/// Reads the scene and applies the overrides. @throws InputError
Scene scene_with(const Overrides& overrides);

/// Phyxels that follow a path, and that loads pull.
struct BoundarySize {
  std::int64_t moved = 0, loaded = 0;
};
/// Of those that are no ghosts.
BoundarySize boundary_size(const Model& model);

/// Bodies, materials, terms, neighbours and warnings, one per line.
/// @param model may be a rank's share
/// @param boundary of the whole
std::string describe_model(const Scene& scene, const Model& model, const BoundarySize& boundary);

/// The value of `--precision`. @throws InputError
Precision precision_option(const std::string& name);

}  // namespace phyxel::app
