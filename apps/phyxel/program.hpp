/// The common part of main() in phyxel and in phyxel_studies (bench/studies).
#pragma once

#include <functional>

#include "cli_forward.hpp"

namespace phyxel::app {

/// Parses the arguments and runs the chosen subcommand on all ranks. Errors become a message on
/// stderr.
///
/// @param check_ranks called between parsing and the subcommand; throws if several ranks cannot run
///   the subcommand
/// @returns the exit code
int run_program(CLI::App& program, int argc, char** argv, const std::function<void()>& check_ranks);

}  // namespace phyxel::app
