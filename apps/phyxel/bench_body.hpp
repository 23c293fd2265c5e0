/// The body that speed is measured on.
#pragma once

#include <string>

#include "phyxel/scene.hpp"

namespace phyxel::app {

/// A jittered cube of about `n` phyxels, 0.1 m apart.
Cloud bench_cube(Index n, bool surfels = false);

/// Bodies of a soft material under gravity.
/// @param terms what the material or the body has beside Green's strain: a name of `bench step
///   --terms`
/// @param factor of the support
Scene bench_scene(const std::string& terms, double factor = NeighbourhoodRule{}.factor,
                  int bodies = 1);

}  // namespace phyxel::app
