/// phyxel: the command-line program. Subcommands live in one file each; this one turns errors
/// into messages and exit codes.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <new>

#include "command.hpp"
#include "phyxel/error.hpp"
#include "version.hpp"

namespace {

int fail(phyxel::ExitCode code, const char* message) {
  fmt::print(stderr, "phyxel: error: {}\n", message);
  return static_cast<int>(code);
}

}  // namespace

int main(int argc, char** argv) {
  using phyxel::ExitCode;
  CLI::App program(
      "Deformable bodies made of phyxels (physics points without a mesh) that carry surfels.");
  program.name("phyxel");
  program.set_version_flag("--version", phyxel::program_version());
  program.require_subcommand(1);
  program.footer(
      "Examples:\n"
      "  phyxel run examples/dino/scene.toml             simulate, write, draw\n"
      "  phyxel sample bunny.obj --phyxels 5000 --out bunny.h5\n"
      "  phyxel info out/dino/phyxels.hdf.series         what is in a file\n"
      "\n"
      "Exit codes: 0 done; 2 wrong input, nothing lost; 3 the simulation diverged, its last good\n"
      "state is on disk; 4 no GPU that could do it, or it failed; 74 writing failed, earlier "
      "files\n"
      "are intact; 75 stopped by a signal, continue with --resume auto.");
  phyxel::app::add_run(program);
  phyxel::app::add_check(program);
  phyxel::app::add_sample(program);
  phyxel::app::add_render(program);
  phyxel::app::add_info(program);
  phyxel::app::add_export(program);
  phyxel::app::add_bench(program);
  phyxel::app::add_paper(program);
  try {
    program.parse(argc, argv);
    return static_cast<int>(ExitCode::success);
  } catch (const CLI::CallForHelp& help) {
    return program.exit(help);
  } catch (const CLI::CallForAllHelp& help) {
    return program.exit(help);
  } catch (const CLI::CallForVersion& version) {
    return program.exit(version);
  } catch (const CLI::ParseError& error) {
    program.exit(error);
    return static_cast<int>(ExitCode::bad_input);
  } catch (const phyxel::Error& error) {
    return fail(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    return fail(ExitCode::bad_input,
                "out of memory: fewer phyxels, or a machine with more memory, are needed");
  } catch (const std::exception& error) {
    return fail(ExitCode::bad_input, error.what());
  }
}
