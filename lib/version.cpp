#include "version.hpp"

// The build defines it for this file only, so that a new commit recompiles nothing else.
#ifndef PHYXEL_VERSION
#define PHYXEL_VERSION "0.0.0"
#endif
#ifndef PHYXEL_COMMIT
#define PHYXEL_COMMIT "unknown"
#endif
#ifndef PHYXEL_COMPILER
#define PHYXEL_COMPILER "unknown compiler"
#endif

namespace phyxel {

std::string program_version() { return "phyxel " PHYXEL_VERSION " (" PHYXEL_COMMIT ")"; }

std::string compiler_name() { return PHYXEL_COMPILER; }

}  // namespace phyxel
