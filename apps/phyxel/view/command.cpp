/// phyxel view: a scene that runs in a browser, where users act on it.
#include "command.hpp"

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>

#include "phyxel/error.hpp"
#include "program_ranks.hpp"
#include "progress.hpp"
#include "stop_signal.hpp"
#include "view/session.hpp"

namespace phyxel::app {
namespace {

void view(const ViewOptions& options) {
  if (options.headless && options.replay.empty()) {
    throw AgreedError(ExitCode::bad_input,
                      "--headless: there is nothing to do; allowed with --replay SESSION");
  }
  if (!(options.pace > 0)) {
    throw AgreedError(ExitCode::bad_input, "--pace nan: allowed: 1e-06 to 1000");
  }
  const StopSignal signals(all_ranks().leads());
  std::optional<LiveScene> live;
  std::optional<Session> session;
  {
    const SetupProgress progress(all_ranks().leads() ? stderr : nullptr);
    live.emplace(ranks().agreed([&] { return scene_with(options.overrides); }), options.cut,
                 options.overrides.unsafe_step);
    session.emplace(options, *live);
  }
  StopSignal::work_begins();
  session->run();
}

}  // namespace

void add_view(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "view",
      "Run a scene live in a browser: look at it, drag bodies, change gravity and stiffness");
  auto options = std::make_shared<ViewOptions>();
  add_overrides(*command, options->overrides);
  command->add_option("--port", options->port, "Port of the page; 0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command
      ->add_option("--host", options->host,
                   "Address of this machine to listen at; another than the default lets other "
                   "machines connect, unencrypted")
      ->capture_default_str();
  command
      ->add_option("--pace", options->pace, "Seconds simulated a second, as far as the machine can")
      ->check(CLI::Range(1e-6, 1e3))
      ->capture_default_str();
  command->add_flag("--paused", options->paused, "Wait for the page's Play");
  command->add_option("--replay", options->replay,
                      "Repeat a saved session (session.jsonl), to the last bit");
  command->add_flag("--headless", options->headless,
                    "With --replay: serve no page, and end with the session");
  command
      ->add_option("--partitioner", options->cut.partitioner,
                   "Partitioner of bodies among the ranks of mpirun: metis, curve, bisection, or "
                   "auto (the best)")
      ->check(CLI::IsMember(partitioner_choices()));
  command->footer(
      "The page's address, with a token that keeps others out, is printed. Ctrl-C ends the view.\n"
      "\n"
      "Examples:\n"
      "  phyxel view examples/dino/scene.toml\n"
      "  phyxel view scene.toml --device cuda --pace 0.1\n"
      "  phyxel view scene.toml --replay out/scene/saved_0001/session.jsonl\n"
      "  ssh -L 8080:localhost:8080 host phyxel view scene.toml   the page of another machine\n"
      "  mpirun -n 4 phyxel view scene.toml");
  command->callback([options] { view(*options); });
}

}  // namespace phyxel::app
