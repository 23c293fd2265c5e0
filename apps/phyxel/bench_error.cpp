#include "bench_error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <omp.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <map>
#include <memory>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "device_option.hpp"
#include "fastest.hpp"
#include "known_names.hpp"
#include "phyxel/phyxel.hpp"
#include "printed_table.hpp"
#include "setup.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

struct ErrorOptions {
  std::vector<std::string> problems{"gravity", "shear", "tension", "twist"};
  std::vector<int> across{4, 6, 8, 12, 16};
  std::vector<std::string> lattices{"nodes", "mesh"};
  std::vector<double> factors{1.5, 1.6, 1.7, 1.8, 2.0};
  std::vector<double> hourglass{0.1};
  std::vector<double> closures;  ///< Empty: 0 for lattices, 0.001 for meshes.
  std::vector<double> safeties{0.8};
  std::vector<double> levels{1, 0.3, 0.1};  ///< [%]
  std::vector<std::string> precisions{"float"};
  std::string device = "cpu", fastest, from;
  double seconds = 0.2;
  TableOptions table;
};

/// A setting, which all resolutions of a family share.
struct Setting {
  Filling filling;
  double factor, hourglass, closure;
  Discretisation at(int across) const {
    return {.filling = filling,
            .factor = factor,
            .hourglass = hourglass,
            .closure = closure,
            .across = across};
  }
  std::vector<std::string> cells() const {
    return {filling_name(filling), fmt::format("{:g}", factor), fmt::format("{:g}", hourglass),
            fmt::format("{:g}", closure)};
  }
};

std::vector<Setting> settings_of(const ErrorOptions& options) {
  std::vector<Setting> all;
  for (const Filling filling : {Filling::nodes, Filling::cells, Filling::mesh}) {
    if (std::find(options.lattices.begin(), options.lattices.end(), filling_name(filling)) ==
        options.lattices.end()) {
      continue;
    }
    const std::vector<double> own{filling == Filling::mesh ? 1e-3 : 0.0};
    for (const double closure : options.closures.empty() ? own : options.closures) {
      for (const double factor : options.factors) {
        for (const double hourglass : options.hourglass) {
          all.push_back({filling, factor, hourglass, closure});
        }
      }
    }
  }
  return all;
}

/// The steps of the bar in one discretisation and precision.
struct StepTime {
  double step = 0;     ///< Largest stable step [s].
  double seconds = 0;  ///< Of a step, on the device.
};

/// Measures the steps of the bar in each precision, for `options.seconds` at least.
std::map<std::string, StepTime> times_of_steps(const Discretisation& d, const ErrorOptions& options,
                                               const ChosenDevice& device) {
  Scene scene = clamped(bar(d, 1, 0.2));
  scene.gravity = {0, 0, -0.1};
  const Cloud cloud = cloud_of(scene, d);
  const Model model = build_model(scene, std::span(&cloud, 1), device);
  std::map<std::string, StepTime> times;
  for (const std::string& precision : options.precisions) {
    const auto backend =
        make_backend(model, precision_option(precision), device, omp_get_max_threads());
    StepTime& found = times[precision];
    found.step = step_limit(model, *backend).largest_step;
    Solver solver(*backend, initial_state(model, scene, options.safeties.front() * found.step));
    solver.step(64);
    backend->wait();
    std::int64_t steps = 0;
    const auto start = Clock::now();
    while (seconds_since(start) < options.seconds) {
      solver.step(256);
      steps += 256;
      backend->wait();
    }
    found.seconds = seconds_since(start) / static_cast<double>(steps);
  }
  return times;
}

/// The problems that the user has chosen, in the order of `phyxel accuracy`.
std::vector<AccuracyCase> problems_of(const ErrorOptions& options) {
  std::vector<AccuracyCase> chosen;
  std::vector<std::string> known;
  for (const AccuracyCase& c : static_cases()) {
    if (c.name == "patch" || c.name == "rotation") continue;
    known.push_back(c.name);
    if (std::find(options.problems.begin(), options.problems.end(), c.name) !=
        options.problems.end()) {
      chosen.push_back(c);
    }
  }
  check_known("problem", options.problems, known);
  return chosen;
}

/// Receiver of rows of `error_columns`.
using RowSink = std::function<void(const std::vector<std::string>&)>;

/// True of problems on the bar whose steps are timed.
bool is_on_bar(const std::string& problem) {
  return problem == "gravity" || problem == "shear" || problem == "tension" || problem == "twist";
}

/// Measures one setting at one resolution.
void measure(const ErrorOptions& options, const ChosenDevice& device, const Setting& setting,
             int across, const std::vector<AccuracyCase>& problems, const RowSink& add_row) {
  const Discretisation d = setting.at(across);
  std::map<std::string, StepTime> times;
  if (std::any_of(problems.begin(), problems.end(),
                  [](const AccuracyCase& c) { return is_on_bar(c.name); })) {
    times = times_of_steps(d, options, device);
  }
  for (const AccuracyCase& problem : problems) {
    const Solution solution = problem.solve(d);
    for (const Quantity& found : solution.found) {
      std::vector<std::string> common{problem.name, found.name};
      const std::vector<std::string> of_setting = setting.cells();
      common.insert(common.end(), of_setting.begin(), of_setting.end());
      common.insert(
          common.end(),
          {std::to_string(across), std::to_string(solution.phyxels),
           fmt::format("{:.1f}", solution.neighbours), fmt::format("{:.4e}", found.error()),
           std::to_string(solution.evaluations), fmt::format("{:.4g}", solution.seconds)});
      if (!is_on_bar(problem.name)) {
        common.resize(error_columns().size());
        add_row(common);
        continue;
      }
      for (const auto& [precision, time] : times) {
        for (const double safety : options.safeties) {
          const double step = safety * time.step;
          std::vector<std::string> row = common;
          row.insert(row.end(), {precision, fmt::format("{:g}", safety),
                                 fmt::format("{:.4g}", step), fmt::format("{:.4g}", time.seconds),
                                 fmt::format("{:.4g}", time.seconds / step)});
          add_row(row);
        }
      }
    }
  }
}

/// Measures all settings. @returns their table
CsvTable measured(const ErrorOptions& options, const ChosenDevice& device) {
  const std::vector<AccuracyCase> problems = problems_of(options);
  PrintedTable table(options.table, error_columns(), device_facts(device));
  CsvTable all;
  all.columns = error_columns();
  const auto add_row = [&](const std::vector<std::string>& row) {
    table.row(row);
    all.rows.push_back(row);
  };
  for (const Setting& setting : settings_of(options)) {
    for (const int across : options.across) {
      try {
        measure(options, device, setting, across, problems, add_row);
      } catch (const InputError& error) {  // too few phyxels for the inside of a mesh
        fmt::print(stderr, "phyxel: {} is left out, {} across, factor {:g}: {}\n",
                   filling_name(setting.filling), across, setting.factor, error.what());
      }
    }
  }
  return all;
}

void bench_error(const ErrorOptions& options) {
  CsvTable all;
  Facts facts;
  if (options.from.empty()) {
    const ChosenDevice device = choose_device(options.device);
    all = measured(options, device);
    facts = device_facts(device);
  } else {
    all = read_csv(options.from);
    facts.emplace_back("from", all.fact("program") + " on " + all.fact("hardware"));
  }
  // JSON is one object: the measured table, or the fastest settings where none is measured.
  const bool json = options.table.json, is_measured = options.from.empty();
  const TableOptions summary{options.fastest, options.table.force, json, json && is_measured};
  PrintedTable table(summary, fastest_columns(), facts);
  for (const auto& row : fastest_settings(all, options.levels)) table.row(row);
}

template <class T, class Check>
void add_list(CLI::App& command, const char* name, std::vector<T>& values, const char* what,
              Check&& check) {
  command.add_option(name, values, what)->delimiter(',')->check(check)->capture_default_str();
}

}  // namespace

void add_bench_error(CLI::App& bench) {
  CLI::App* command = bench.add_subcommand(
      "error",
      "Measure the time that it takes to reach an error, over spacings, supports and the rest, and "
      "find the fastest settings");
  auto options = std::make_shared<ErrorOptions>();
  command
      ->add_option("problems", options->problems,
                   "Problems of `phyxel accuracy` at rest. Of those on its bar (gravity, shear, "
                   "tension, twist) steps are timed, too: the seconds that one simulated second "
                   "takes, in which the bar swings once")
      ->capture_default_str();
  add_list(*command, "--across", options->across, "Numbers of cells across the thinner sides",
           CLI::Range(2, 200));
  add_list(*command, "--lattice", options->lattices,
           "Placements of phyxels: nodes, cells, or mesh (on and in a surface)",
           CLI::IsMember({"nodes", "cells", "mesh"}));
  add_list(*command, "--factor", options->factors,
           "Support radii, in mean distances to the ten nearest phyxels", CLI::Range(1.0, 4.0));
  add_list(*command, "--hourglass", options->hourglass, "Strengths of hourglass control",
           CLI::Range(0.0, 100.0));
  command
      ->add_option("--closure", options->closures,
                   "Tolerances of closed gradients; 0 for none (default: 0 for lattices, 0.001 for "
                   "meshes)")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 1.0));
  add_list(*command, "--safety", options->safeties, "Steps over the largest stable one",
           CLI::Range(0.01, 1.0));
  add_list(*command, "--level", options->levels, "Errors to reach [%]", CLI::Range(1e-6, 100.0));
  add_list(*command, "--precision", options->precisions,
           "Precisions of steps: float, double, mixed",
           CLI::IsMember({"float", "double", "mixed"}));
  command->add_option("--device", options->device, device_help)->capture_default_str();
  command->add_option("--seconds", options->seconds, "Least time of each measurement of steps [s]")
      ->check(CLI::Range(0.001, 100.0))
      ->capture_default_str();
  command->add_option(
      "--from", options->from,
      "Measure nothing: take the errors and times from a table that --csv has written");
  command->add_option("--fastest", options->fastest,
                      "Also write the table of the fastest settings to this file");
  add_table_options(*command, options->table);
  command->footer(
      "The first table has the errors and times of all settings; the second one, for each error, "
      "the fastest setting of each problem and of the worst of all problems. An error counts as "
      "reached where all finer clouds are as good, too: at one spacing it may be small by chance, "
      "as where it changes its sign.\n"
      "Examples:\n"
      "  phyxel bench error\n"
      "  phyxel bench error gravity --lattice nodes --factor 1.6,1.8 --device cuda --csv "
      "error.csv");
  command->callback([options] {
    std::sort(options->across.begin(), options->across.end());
    bench_error(*options);
  });
}

}  // namespace phyxel::app
