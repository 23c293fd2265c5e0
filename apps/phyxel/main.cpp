/// phyxel: the command-line program. Each subcommand has a file; exceptions become a message and an
/// exit code (program.hpp).
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "command.hpp"
#include "phyxel/error.hpp"
#include "program.hpp"
#include "program_ranks.hpp"
#include "thread_policy.hpp"
#include "version.hpp"

namespace {

using phyxel::app::ranks;

/// Refuses commands that do not run on several ranks. @throws AgreedError
void check_ranks(const CLI::App& program) {
  if (ranks().size() == 1 || program.got_subcommand("run") || program.got_subcommand("view") ||
      program.got_subcommand("doctor") ||
      program.get_subcommand("bench")->got_subcommand("scaling")) {
    return;
  }
  throw phyxel::AgreedError(phyxel::ExitCode::bad_input,
                            fmt::format("{} ranks; allowed with \"phyxel run\", \"phyxel view\", "
                                        "\"phyxel doctor\" and \"phyxel bench "
                                        "scaling\"; start other commands without mpirun",
                                        ranks().size()));
}

}  // namespace

int main(int argc, char** argv) {
  phyxel::app::settle_thread_policy(argv);  // first, since it restarts the program
  CLI::App program(
      "Deformable bodies made of phyxels (physics points without a mesh) that carry surfels.");
  program.name("phyxel");
  program.set_version_flag("--version", phyxel::program_version());
  program.require_subcommand(1);
  program.footer(
      "Examples:\n"
      "  phyxel examples copy dino                       copy one of the examples\n"
      "  phyxel run dino/scene.toml                      simulate, write, draw\n"
      "  phyxel view dino/scene.toml                     run it live in a browser\n"
      "  phyxel sample bunny.obj --phyxels 5000 --out bunny.h5\n"
      "  phyxel info out/dino/phyxels.hdf.series         show the content of a file\n"
      "\n"
      "Exit codes: 0 done; 2 wrong input, nothing lost; 3 the simulation diverged, its last good\n"
      "state is on disk; 4 no usable GPU, or it failed; 74 writing failed, earlier "
      "files\n"
      "are intact; 75 stopped by a signal, continue with --resume auto.");
  phyxel::app::add_run(program);
  phyxel::app::add_view(program);
  phyxel::app::add_sample(program);
  phyxel::app::add_render(program);
  phyxel::app::add_info(program);
  phyxel::app::add_export(program);
  phyxel::app::add_report(program);
  phyxel::app::add_bench(program);
  phyxel::app::add_accuracy(program);
  phyxel::app::add_paper(program);
  phyxel::app::add_examples(program);
  phyxel::app::add_doctor(program);
  phyxel::app::add_completion(program);
  return phyxel::app::run_program(program, argc, argv, [&] { check_ranks(program); });
}
