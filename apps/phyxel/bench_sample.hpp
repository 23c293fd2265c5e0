/// phyxel bench sample: how fast meshes are filled, and how good the clouds are.
#pragma once

#include "cli_forward.hpp"

namespace phyxel::app {

void add_bench_sample(CLI::App& bench);

}  // namespace phyxel::app
