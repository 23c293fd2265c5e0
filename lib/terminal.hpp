/// Properties of output streams, and coloured words.
#pragma once

#include <cstdio>
#include <string>

namespace phyxel {

/// True for a terminal that can redraw and colour lines (TERM is not "dumb").
bool is_terminal(std::FILE* stream);

/// The words "error: " and "warning: ", coloured if stderr is a terminal and NO_COLOR is not set
/// (no-color.org).
std::string error_word();
std::string warning_word();

}  // namespace phyxel
