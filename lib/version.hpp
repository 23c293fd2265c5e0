/// Version of the program, for summaries, files and benchmarks.
#pragma once

#include <string>

namespace phyxel {

/// Name, version and commit, e.g. "phyxel 0.1.0 (1a2b3c4)".
std::string program_version();

/// Compiler and flags of the CPU kernels, e.g. "GNU 12.2.0 -O3 -march=native".
std::string compiler_name();

}  // namespace phyxel
