/// Error messages for command lines.
#pragma once

#include <string>

#include "cli_forward.hpp"

namespace phyxel::app {

/// The error of a command line in one line: the first unknown command or option, with the nearest
/// known one; otherwise the option and its value as typed, with CLI11's message. The text has
/// neither "phyxel: error: " nor a line end.
std::string complaint(const CLI::App& program, const CLI::ParseError& error, int argc,
                      const char* const* argv);

}  // namespace phyxel::app
