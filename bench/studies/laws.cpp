/// phyxel_studies laws: which law a scene that names none should have.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "accuracy/accuracy.hpp"
#include "bench_body.hpp"
#include "law_scenes.hpp"
#include "phyxel/phyxel.hpp"
#include "printed_table.hpp"
#include "stopwatch.hpp"
#include "studies.hpp"

namespace phyxel::studies {
namespace {

struct LawOptions {
  std::vector<std::string> meshes{"examples/mesh/ring.obj"};
  std::vector<std::string> laws;
  std::vector<std::string> cases;  ///< Names of scenes; none: all, and speed and accuracy.
  double most_seconds = 120;       ///< Of one run.
  app::TableOptions table;
};

/// The laws that E and ν are all parameters of.
std::vector<std::string> laws_of_young_and_poisson() {
  std::vector<std::string> names;
  for (const LawEntry& law : law_table()) {
    if (std::none_of(law.parameters.begin(), law.parameters.end(), is_own_parameter)) {
      names.emplace_back(law.name);
    }
  }
  return names;
}

/// What came of a scene.
struct Outcome {
  Index phyxels = 0;
  double reached = 0;        ///< Share of the simulated time.
  double inverted = 0;       ///< Share of phyxels with det F <= 0 at the end.
  double ever_inverted = 0;  ///< Largest such share at any frame.
  double farthest = 0;       ///< Largest displacement at the end [m].
  std::int64_t halvings = 0, doublings = 0, steps = 0;
  double seconds = 0;   ///< Of the steps.
  std::string message;  ///< Why it did not reach the end.
};

/// Runs a scene as `phyxel run` does: its steps and its watch.
Outcome run(const Scene& scene, const FirstScene& first, const std::vector<Cloud>& clouds,
            double most_seconds) {
  Outcome outcome;
  const Model model = build_model(scene, clouds);
  outcome.phyxels = model.size();
  const auto backend = make_cpu_backend(model, scene.solver.precision);
  StepPlan plan = plan_steps(scene, model, *backend);
  State begin = initial_state(model, scene, plan.dt);
  for (Index i = 0; first.start && i < model.size(); ++i) {
    begin.displacement[i] = first.start(model.position[i]);
  }
  Solver solver(model, *backend, begin, Method::verlet);
  StepControl control(model, *backend, plan);
  StabilityWatch watch(model, diagnose(model, *backend, solver));
  const auto start = app::Clock::now();
  try {
    while (solver.steps() < plan.steps && outcome.message.empty()) {
      const int made = control.look(solver, plan.halvings);
      plan.halve(made);
      outcome.halvings += std::max(0, made);
      solver.step();
      ++outcome.steps;
      if (solver.steps() % plan.steps_per_frame != 0) continue;
      const Diagnostics now = diagnose(model, *backend, solver);
      outcome.inverted = static_cast<double>(now.inverted) / model.size();
      outcome.farthest = now.largest_displacement;
      outcome.ever_inverted = std::max(outcome.ever_inverted, outcome.inverted);
      watch.check(now, &control);
      if (app::seconds_since(start) > most_seconds) {
        outcome.message = fmt::format("stopped after {:g} s", most_seconds);
      }
    }
  } catch (const DivergedError& error) {
    outcome.message = error.what();
  }
  outcome.seconds = app::seconds_since(start);
  outcome.doublings = solver.looks().doublings;
  outcome.reached = solver.time() / (plan.dt * static_cast<double>(plan.steps));
  return outcome;
}

class LawTable {
 public:
  explicit LawTable(const app::TableOptions& options)
      : table_(options,
               {"part", "case", "law", "phyxels", "reached", "inverted", "ever_inverted",
                "farthest_m", "halvings", "doublings", "steps", "seconds", "error", "message"}) {}

  void add(const std::string& name, const std::string& law, const Outcome& o) {
    std::string message = o.message;
    std::replace(message.begin(), message.end(), ',', ';');
    table_.row({"scene", name, law, std::to_string(o.phyxels), fmt::format("{:.3g}", o.reached),
                fmt::format("{:.4f}", o.inverted), fmt::format("{:.4f}", o.ever_inverted),
                fmt::format("{:.3g}", o.farthest), std::to_string(o.halvings),
                std::to_string(o.doublings), std::to_string(o.steps),
                fmt::format("{:.3g}", o.seconds), "", message});
  }
  void add_time(const std::string& precision, const std::string& law, Index phyxels,
                double seconds) {
    table_.row({"speed", precision, law, std::to_string(phyxels), "", "", "", "", "", "", "",
                fmt::format("{:.4g}", seconds), "", ""});
  }
  void add_error(const std::string& name, const std::string& law, Index phyxels, double error) {
    table_.row({"accuracy", name, law, std::to_string(phyxels), "", "", "", "", "", "", "", "",
                fmt::format("{:.4e}", error), ""});
  }

 private:
  app::PrintedTable table_;
};

void run_scenes(const LawOptions& options, LawTable& table) {
  for (const FirstScene& first : first_scenes({options.meshes.begin(), options.meshes.end()})) {
    const bool is_asked =
        options.cases.empty() ||
        std::find(options.cases.begin(), options.cases.end(), first.name) != options.cases.end();
    if (!is_asked) continue;
    const std::vector<Cloud> clouds{make_cloud(first.scene.bodies[0])};
    for (const std::string& law : options.laws) {
      Scene scene = first.scene;
      scene.bodies[0].material.law = law;
      table.add(first.name, law, run(scene, first, clouds, options.most_seconds));
    }
  }
}

/// Seconds of a step of a strained cube, the laws in turns: the fastest turn of each.
void measure_speed(const LawOptions& options, LawTable& table) {
  constexpr int turns = 7, steps = 30;
  const Cloud cloud = app::bench_cube(27000);
  for (const Precision precision : {Precision::single, Precision::double_}) {
    struct Runner {
      Model model;
      std::unique_ptr<Backend> backend;
      std::unique_ptr<Solver> solver;
      double best = HUGE_VAL;
    };
    std::vector<Runner> runners;
    runners.reserve(options.laws.size());  // backends refer to their models
    for (const std::string& law : options.laws) {
      Scene scene = app::bench_scene("green");
      scene.bodies[0].material.law = law;
      Runner& runner = runners.emplace_back();
      runner.model = build_model(scene, std::span(&cloud, 1));
      runner.backend = make_cpu_backend(runner.model, precision);
      State state = initial_state(runner.model, scene,
                                  0.5 * step_limit(runner.model, *runner.backend).largest_step);
      for (Index i = 0; i < runner.model.size(); ++i) {
        const Vec3d& x = runner.model.position[i];
        state.displacement[i] = {0.1 * x.y, -0.05 * x.z, 0.02 * x.x};
      }
      runner.solver = std::make_unique<Solver>(*runner.backend, state);
    }
    for (int turn = 0; turn < turns; ++turn) {
      for (Runner& runner : runners) {
        const auto start = app::Clock::now();
        for (int s = 0; s < steps; ++s) runner.solver->step();
        runner.backend->wait();
        runner.best = std::min(runner.best, app::seconds_since(start) / steps);
      }
    }
    for (std::size_t k = 0; k < runners.size(); ++k) {
      table.add_time(precision_name(precision), options.laws[k], runners[k].model.size(),
                     runners[k].best);
    }
  }
}

/// Cases of `phyxel accuracy` in which strains are small, at the discretisation that scenes have
/// by default, and closed.
void measure_accuracy(const LawOptions& options, LawTable& table) {
  for (const app::AccuracyCase& known : app::accuracy_cases()) {
    const bool is_small = known.name == "tension" || known.name == "gravity" ||
                          known.name == "shear" || known.name == "elastica";
    if (!is_small) continue;
    for (const std::string& law : options.laws) {
      const app::Solution solution =
          known.solve({.law = law.c_str(), .hourglass = 0.1, .closure = 1e-3, .across = 6});
      for (const app::Quantity& quantity : solution.found) {
        table.add_error(known.name + ": " + quantity.name, law, solution.phyxels, quantity.error());
      }
    }
  }
}

void measure_laws(LawOptions options) {
  const std::vector<std::string> all = laws_of_young_and_poisson();
  if (options.laws.empty()) options.laws = all;
  for (const std::string& law : options.laws) {
    if (std::find(all.begin(), all.end(), law) != all.end()) continue;
    throw InputError(
        fmt::format("--law {}: unknown, or with other parameters than E and ν; "
                    "allowed: {}",
                    law, fmt::join(all, ", ")));
  }
  LawTable table(options.table);
  run_scenes(options, table);
  if (!options.cases.empty()) return;
  measure_speed(options, table);
  measure_accuracy(options, table);
}

}  // namespace

void add_laws(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "laws", "Compare laws as the default: first scenes, speed and accuracy of each");
  auto options = std::make_shared<LawOptions>();
  command
      ->add_option("--mesh", options->meshes,
                   "Closed surfaces for the scenes of standing and "
                   "hanging bodies")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--law", options->laws,
                   "Laws, comma separated (default: all with E and ν as "
                   "their only parameters)")
      ->delimiter(',');
  command
      ->add_option("--case", options->cases,
                   "Scenes, comma separated, to run without measurements of speed and accuracy "
                   "(default: all)")
      ->delimiter(',');
  command->add_option("--seconds", options->most_seconds, "Time limit of a run [s]")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app::add_table_options(*command, options->table);
  command->footer(
      "Examples:\n"
      "  phyxel_studies laws --csv docs/results/laws.csv --force\n"
      "  phyxel_studies laws --mesh bunny.obj --law hencky,corotated");
  command->callback([options] { measure_laws(*options); });
}

}  // namespace phyxel::studies
