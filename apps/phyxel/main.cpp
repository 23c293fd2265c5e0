/// phyxel: the command-line program. Subcommands live in one file each; what they throw becomes a
/// message and an exit code (program.hpp).
#include <fmt/format.h>

#include "command.hpp"
#include "phyxel/error.hpp"
#include "program.hpp"
#include "program_ranks.hpp"
#include "thread_policy.hpp"
#include "version.hpp"

namespace {

using phyxel::app::ranks;

/// What several ranks can do.
void check_ranks(const CLI::App& program) {
  if (ranks().size() == 1 || program.got_subcommand("run") || program.got_subcommand("check") ||
      program.got_subcommand("doctor") ||
      program.get_subcommand("bench")->got_subcommand("scaling")) {
    return;
  }
  throw phyxel::AgreedError(
      phyxel::ExitCode::bad_input,
      fmt::format("{} ranks: allowed with \"phyxel run\", \"phyxel check\", \"phyxel doctor\" and "
                  "\"phyxel bench scaling\"; start all else without mpirun",
                  ranks().size()));
}

}  // namespace

int main(int argc, char** argv) {
  phyxel::app::settle_thread_policy(argv);  // first: it starts the program again
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
  phyxel::app::add_report(program);
  phyxel::app::add_bench(program);
  phyxel::app::add_accuracy(program);
  phyxel::app::add_paper(program);
  phyxel::app::add_doctor(program);
  phyxel::app::add_completion(program);
  return phyxel::app::run_program(program, argc, argv, [&] { check_ranks(program); });
}
