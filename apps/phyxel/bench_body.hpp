/// Bodies and scenes of the speed measurements.
#pragma once

#include <string>
#include <vector>

#include "phyxel/scene.hpp"

namespace phyxel::app {

/// A jittered cube of about `n` phyxels, 0.1 m apart.
Cloud bench_cube(Index n, bool surfels = false);

/// The names of `bench step --terms`: the laws, then terms beside Hooke's law in Green's strain, of
/// which "surfels" moves the surfels after every step.
std::vector<std::string> bench_terms();

/// A scene of equal bodies of a soft material under gravity.
/// @param terms a name of `bench step --terms`: the term beside Green's strain, or instead of it
/// @param factor support factor
Scene bench_scene(const std::string& terms, double factor = NeighbourhoodRule{}.factor,
                  int bodies = 1);

}  // namespace phyxel::app
