/// A scene with the overrides of the command line, and its description.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli_forward.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/solver.hpp"

namespace phyxel::app {

/// Options that override keys of the scene.
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

/// Number of phyxels with prescribed displacements, and with loads.
struct BoundarySize {
  std::int64_t moved = 0, loaded = 0;
  std::int64_t touching = 0;         ///< Those that may touch obstacles.
  std::int64_t touching_bodies = 0;  ///< Those that may touch bodies.
};
/// Counts the boundary phyxels of a model, without ghosts.
BoundarySize boundary_size(const Model& model);

/// The least and the largest support of a part [m].
struct SupportRange {
  double least = 0, largest = 0;
};
/// The range of each part of a model. Collective on a share.
std::vector<SupportRange> support_ranges(const Model& model);

/// Description of bodies, materials, terms, neighbours and warnings, line by line.
/// @param model may be a rank's share
/// @param boundary counts of the whole model
/// @param supports result of `support_ranges`
std::string describe_model(const Scene& scene, const Model& model, const BoundarySize& boundary,
                           const std::vector<SupportRange>& supports);

/// The value of `--precision`. @throws InputError
Precision precision_option(const std::string& name);

}  // namespace phyxel::app
