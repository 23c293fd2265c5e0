/// Bodies and scenes of the speed measurements.
#pragma once

#include <string>
#include <vector>

#include "command.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// A jittered cube of about `n` phyxels with a spacing of 0.1 m.
ShapeRequest bench_shape(Index n, bool surfels = false);
Cloud bench_cube(Index n, bool surfels = false);

/// The names of `bench step --terms`: the laws, then terms added to St Venant-Kirchhoff's law;
/// "surfels" also moves the surfels after each step.
std::vector<std::string> bench_terms();

/// A scene of equal bodies of a soft material under gravity.
/// @param terms a name of `bench step --terms`
/// @param factor support factor
Scene bench_scene(const std::string& terms, double factor = NeighbourhoodRule{}.factor,
                  int bodies = 1);

/// Adds the option --repeat of speed measurements.
void add_repeats(CLI::App& command, int& repeats);
/// Adds the options --phyxels and --repeat of speed measurements.
void add_size_options(CLI::App& command, std::vector<Index>& sizes, int& repeats);
/// Adds the option --threads of speed measurements.
void add_thread_counts(CLI::App& command, std::vector<int>& threads);
/// Adds the option --seconds, the length of one repeat [s].
void add_seconds_option(CLI::App& command, double& seconds);

}  // namespace phyxel::app
