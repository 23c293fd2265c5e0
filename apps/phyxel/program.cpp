#include "program.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include "complaint.hpp"
#include "phyxel/error.hpp"
#include "phyxel/ranks.hpp"
#include "program_ranks.hpp"
#include "terminal.hpp"

namespace phyxel::app {
namespace {

/// Throws the OutputError for a standard output that lost data, by a full disk or a closed pipe.
[[noreturn]] void refuse_standard_output(int error) {
  throw OutputError(fmt::format("standard output: cannot be written: {}",
                                std::generic_category().message(error)));
}

}  // namespace

int run_program(CLI::App& program, int argc, char** argv,
                const std::function<void()>& check_ranks) {
  return on_ranks(argc, argv, [&](const Ranks& all) {
    set_ranks(all);
    program.parse_complete_callback(check_ranks);
    try {
      program.parse(argc, argv);
      if (std::fflush(stdout) != 0 || std::ferror(stdout)) refuse_standard_output(errno);
      return static_cast<int>(ExitCode::success);
    } catch (const std::system_error& error) {
      if (!std::ferror(stdout)) throw;
      refuse_standard_output(error.code().value());
    } catch (const CLI::Success& help) {  // --help or --version
      return all.leads() ? program.exit(help) : 0;
    } catch (const CLI::ParseError& error) {
      if (all.leads()) {
        fmt::print(stderr, "phyxel: {}{}\n", error_word(), complaint(program, error, argc, argv));
      }
      return static_cast<int>(ExitCode::bad_input);
    }
  });
}

}  // namespace phyxel::app
