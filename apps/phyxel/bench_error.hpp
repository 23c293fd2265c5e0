/// phyxel bench error: the time that it takes to reach an error.
#pragma once

#include "cli_forward.hpp"

namespace phyxel::app {

void add_bench_error(CLI::App& bench);

}  // namespace phyxel::app
