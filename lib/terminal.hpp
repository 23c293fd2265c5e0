/// What a stream leads to, and words that stand out there.
#pragma once

#include <cstdio>
#include <string>

namespace phyxel {

/// Whether lines can be drawn again and coloured: a terminal, and none that calls itself dumb.
bool is_terminal(std::FILE* stream);

/// "error: " and "warning: " as stderr can show them: coloured on a terminal, unless NO_COLOR is
/// set (no-color.org).
std::string error_word();
std::string warning_word();

}  // namespace phyxel
