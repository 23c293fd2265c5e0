/// phyxel bench scaling: the speed of a body on the ranks that mpirun has started.
#pragma once

#include "cli_forward.hpp"

namespace phyxel::app {

void add_bench_scaling(CLI::App& bench);

}  // namespace phyxel::app
