/// What is wrong with a command line, in one line.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace phyxel::app {

/// The first word that is no command or option, with the nearest one that is; else the option and
/// value as they were typed, and what CLI11 says of them. Without "phyxel: error: " and a line end.
std::string complaint(const CLI::App& program, const CLI::ParseError& error, int argc,
                      const char* const* argv);

}  // namespace phyxel::app
