/// The commands `phyxel run` and `phyxel check`.
#include "command.hpp"

#include "profile.hpp"
#include "run/run.hpp"

namespace phyxel::app {
namespace {

/// What the run is made of, with the stages of that shown.
std::unique_ptr<Run> set_up(const RunOptions& options) {
  const bool speaks = !options.quiet && !options.json && ranks().rank() == 0;
  const SetupProgress progress(speaks ? stderr : nullptr);
  return std::make_unique<Run>(options);
}

void run(const RunOptions& options) {
  if (options.dry_run) {
    set_up(options)->rehearse();
    return;
  }
  if (options.profile.empty()) {
    set_up(options)->execute();
    return;
  }
  start_profile(options.profile, options.force);
  try {
    set_up(options)->execute();
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
      ->add_option(
          "--partitioner", options->cut.partitioner,
          "How mpirun's ranks cut the bodies: metis, curve, bisection, or auto, the best of "
          "the three")
      ->check(CLI::IsMember(partitioner_choices()));
  command
      ->add_option("--transport", options->transport,
                   "How ranks' GPUs exchange: direct (stores into each other's memory), nccl, mpi "
                   "(a CUDA-aware one), host (MPI through the host's memory), or auto")
      ->check(CLI::IsMember(transport_names()));
  command->add_flag("--force", options->force,
                    "Replace an earlier trajectory in the output folder");
  command->add_flag("--no-pictures", options->no_pictures,
                    "Leave out the pictures the scene asks for");
  command->add_flag("--quiet", options->quiet, "No progress, no plan; only the summary");
  command->add_flag("--json", options->json, "The summary as JSON, nothing else on stdout");
  command->add_flag("--dry-run", options->dry_run,
                    "Only the plan: step, memory, device, ranks, forecast; as phyxel check does");
  command->add_option("--profile", options->profile,
                      "Write what each rank does when to this file, for a trace viewer "
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

void add_check(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "check", "Read a scene, build its model and print the plan: time step, memory, forecast");
  auto options = std::make_shared<RunOptions>();
  options->dry_run = true;
  add_overrides(*command, options->overrides);
  command->add_flag("--json", options->json, "The plan as JSON, nothing else on stdout");
  command->footer(
      "Examples:\n"
      "  phyxel check examples/dino/scene.toml\n"
      "  phyxel check scene.toml --device cpu --precision double --json\n"
      "  mpirun -n 8 phyxel check scene.toml");
  command->callback([options] { run(*options); });
}

}  // namespace phyxel::app
