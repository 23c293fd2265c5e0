/// What the program and the developers' studies (bench/studies) share: from arguments to an exit
/// code.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace phyxel::app {

/// Parses the arguments and runs the subcommand that they choose, on all ranks. Errors become a
/// message on stderr.
///
/// @param check_ranks called after parsing and before the subcommand; throws what several ranks
///   cannot do
/// @returns the exit code
int run_program(CLI::App& program, int argc, char** argv, const std::function<void()>& check_ranks);

}  // namespace phyxel::app
