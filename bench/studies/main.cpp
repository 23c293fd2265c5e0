/// phyxel_studies: measurements for developers. The program is not installed.
#include "phyxel/error.hpp"
#include "program.hpp"
#include "program_ranks.hpp"
#include "studies.hpp"
#include "thread_policy.hpp"
#include "version.hpp"

int main(int argc, char** argv) {
  phyxel::app::settle_thread_policy(argv);  // first, since it restarts the program
  CLI::App program("Measurements behind the pages in docs/, for developers of phyxel.");
  program.name("phyxel_studies");
  program.set_version_flag("--version", phyxel::program_version());
  program.require_subcommand(1);
  program.footer(
      "Examples:\n"
      "  phyxel_studies steps --csv docs/results/accuracy_steps.csv --force\n"
      "  phyxel_studies setup --device cuda");
  phyxel::studies::add_accuracy_studies(program);
  phyxel::studies::add_pictures(program);
  phyxel::studies::add_setup(program);
  phyxel::studies::add_neighbour_search(program);
  phyxel::studies::add_laws(program);
  phyxel::studies::add_problems(program);
  return phyxel::app::run_program(program, argc, argv, [] {
    if (phyxel::app::ranks().size() == 1) return;
    throw phyxel::AgreedError(phyxel::ExitCode::bad_input,
                              "phyxel_studies measures on one rank: start it without mpirun");
  });
}
