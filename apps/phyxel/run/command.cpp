/// phyxel run: the simulation of a scene.
#include "command.hpp"

#include <CLI/CLI.hpp>

#include "profile.hpp"
#include "run/run.hpp"

namespace phyxel::app {
namespace {

/// Sets the run up, and shows the stages of set-up.
std::unique_ptr<Run> set_up(const RunOptions& options) {
  const bool speaks = !options.quiet && !options.json && ranks().rank() == 0;
  const SetupProgress progress(speaks ? stderr : nullptr);
  return std::make_unique<Run>(options);
}

/// Runs the scene, or prints the plan of the run.
void run_or_rehearse(const RunOptions& options) {
  const std::unique_ptr<Run> run = set_up(options);
  options.dry_run ? run->rehearse() : run->execute();
}

void run(const RunOptions& options) {
  if (options.profile.empty()) {
    run_or_rehearse(options);
    return;
  }
  start_profile(options.profile, options.force);
  try {
    run_or_rehearse(options);
  } catch (const AgreedError&) {  // on all ranks, e.g. after a signal
    write_profile(options.profile);
    throw;
  }
  write_profile(options.profile);
}

}  // namespace

void add_run(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("run", "Simulate a scene, write its trajectory and pictures");
  auto options = std::make_shared<RunOptions>();
  add_overrides(*command, options->overrides);
  command->add_option(
      "--resume", options->resume,
      "Continue from a checkpoint file, or from the newest in the output folder (auto)");
  command
      ->add_option("--partitioner", options->cut.partitioner,
                   "Partitioner of bodies among the ranks of mpirun: metis, curve, bisection, or "
                   "auto (the best)")
      ->check(CLI::IsMember(partitioner_choices()));
  command
      ->add_option("--transport", options->transport,
                   "Transport between the ranks' GPUs: direct (stores into each other's memory), "
                   "nccl, mpi (CUDA-aware), host (MPI through host memory), or auto")
      ->check(CLI::IsMember(transport_names()));
  command->add_flag("--force", options->force,
                    "Replace an earlier trajectory in the output folder");
  command->add_flag("--no-pictures", options->no_pictures,
                    "Do not draw the pictures that the scene requests");
  command->add_flag("--quiet", options->quiet, "Print the summary only, no plan and no progress");
  command->add_flag("--json", options->json, "The summary as JSON, nothing else on stdout");
  command->add_flag("--dry-run", options->dry_run,
                    "Print the plan only: time step, memory, device, ranks, forecast; write "
                    "nothing but the profile");
  command->add_option("--profile", options->profile,
                      "Write a timeline of all ranks to this file, for a trace viewer "
                      "(chrome://tracing, ui.perfetto.dev)");
  command->footer(
      "Examples:\n"
      "  phyxel run examples/dino/scene.toml --out out/dino\n"
      "  phyxel run scene.toml --precision double --until 0.5 --force\n"
      "  phyxel run scene.toml --dry-run\n"
      "  phyxel run scene.toml --resume auto\n"
      "  mpirun -n 8 phyxel run scene.toml");
  command->callback([options] { run(*options); });
}

}  // namespace phyxel::app
