/// Bodies and scenes of the speed measurements.
#pragma once

#include <string>
#include <vector>

#include "phyxel/scene.hpp"

namespace phyxel::app {

/// A jittered cube of about `n` phyxels with a spacing of 0.1 m.
Cloud bench_cube(Index n, bool surfels = false);

/// The names of `bench step --terms`: the laws, then terms added to St Venant-Kirchhoff's law;
/// "surfels" also moves the surfels after each step.
std::vector<std::string> bench_terms();

/// A scene of equal bodies of a soft material under gravity.
/// @param terms a name of `bench step --terms`
/// @param factor support factor
Scene bench_scene(const std::string& terms, double factor = NeighbourhoodRule{}.factor,
                  int bodies = 1);

}  // namespace phyxel::app
