/// phyxel accuracy: problems with known answers, over resolutions and discretisations.
#include "command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <set>

#include "accuracy/accuracy.hpp"
#include "accuracy/hard_cases.hpp"
#include "device_option.hpp"
#include "known_names.hpp"
#include "phyxel/error.hpp"
#include "printed_table.hpp"

namespace phyxel::app {
namespace {

struct AccuracyOptions {
  std::vector<std::string> cases{"all"};
  std::vector<int> across;  ///< Resolutions; if empty, those of each case.
  std::vector<std::string> lattices{"nodes", "cells", "mesh"};
  std::vector<double> factors{1.8};
  std::vector<double> jitters, hourglass, closures;  ///< Empty: each case's own.
  TableOptions table;
};

std::vector<AccuracyCase> chosen_cases(const std::vector<std::string>& names) {
  const std::vector<AccuracyCase> all = accuracy_cases();
  std::vector<AccuracyCase> chosen;
  std::vector<std::string> known{"all"};
  std::set<std::string> groups;
  for (const AccuracyCase& c : all) {
    known.push_back(c.name);
    if (!c.group.empty()) groups.insert(c.group);
  }
  known.insert(known.end(), groups.begin(), groups.end());
  check_known("case", names, known);
  for (const AccuracyCase& c : all) {
    const bool wanted = std::any_of(names.begin(), names.end(), [&](const std::string& name) {
      return name == c.name || name == "all" || (!c.group.empty() && name == c.group);
    });
    if (wanted) chosen.push_back(c);
  }
  return chosen;
}

std::vector<Discretisation> discretisations(const AccuracyOptions& options,
                                            const AccuracyCase& of) {
  const auto given_or = [](const std::vector<double>& values, const std::vector<double>& own) {
    return values.empty() ? own : values;
  };
  const std::vector<double> closures = given_or(options.closures, of.closures);
  const std::vector<double> jitters = given_or(options.jitters, of.jitters);
  std::vector<Discretisation> list;
  for (const Filling filling : of.fillings) {
    if (std::find(options.lattices.begin(), options.lattices.end(), filling_name(filling)) ==
        options.lattices.end()) {
      continue;
    }
    for (const double jitter : jitters) {
      if (filling == Filling::mesh && jitter != jitters.front()) continue;  // has none
      for (const double factor : options.factors) {
        for (const double hourglass : given_or(options.hourglass, of.hourglass)) {
          for (const double closure : closures) {
            list.push_back({.filling = filling,
                            .jitter = filling == Filling::mesh ? 0 : jitter,
                            .factor = factor,
                            .hourglass = hourglass,
                            .closure = closure});
          }
        }
      }
    }
  }
  return list;
}

/// The order of convergence in the spacing between two resolutions; "" for the first resolution,
/// and for errors that change their sign.
std::string order_of(double coarse, double fine, int across_coarse, int across_fine) {
  if (coarse * fine <= 0) return "";
  return fmt::format("{:.2f}", std::log(coarse / fine) /
                                   std::log(static_cast<double>(across_fine) / across_coarse));
}

void measure(const AccuracyOptions& options) {
  const std::vector<AccuracyCase> cases = chosen_cases(options.cases);
  PrintedTable table(options.table,
                     {"case", "quantity", "lattice", "jitter", "factor", "hourglass", "closure",
                      "across", "phyxels", "neighbours", "value", "reference", "error", "order",
                      "evaluations", "seconds", "setup_seconds"});
  for (const AccuracyCase& c : cases) {
    for (Discretisation d : discretisations(options, c)) {
      std::vector<double> before;
      int across_before = 0;
      for (const int across : options.across.empty() ? c.across : options.across) {
        d.across = across;
        Solution solution;
        try {
          solution = c.solve(d);
        } catch (const InputError& error) {  // too few phyxels for the inside of a mesh
          if (d.filling != Filling::mesh) throw;
          fmt::print(stderr, "phyxel: {} on a mesh, {} across, is left out: {}\n", c.name, across,
                     error.what());
          continue;
        }
        for (std::size_t q = 0; q < solution.found.size(); ++q) {
          const Quantity& found = solution.found[q];
          table.row(
              {c.name, found.name, filling_name(d.filling), fmt::format("{:g}", d.jitter),
               fmt::format("{:g}", d.factor), fmt::format("{:g}", d.hourglass),
               fmt::format("{:g}", d.closure), std::to_string(across),
               std::to_string(solution.phyxels), fmt::format("{:.1f}", solution.neighbours),
               fmt::format("{:.7g}", found.value), fmt::format("{:.7g}", found.reference),
               fmt::format("{:.3e}", found.error()),
               before.empty() ? "" : order_of(before[q], found.error(), across_before, across),
               std::to_string(solution.evaluations), fmt::format("{:.4g}", solution.seconds),
               fmt::format("{:.4g}", solution.setup_seconds)});
        }
        before.clear();
        for (const Quantity& found : solution.found) before.push_back(found.error());
        across_before = across;
      }
    }
  }
}

/// The names and descriptions of all cases, for help.
std::string listed_cases() {
  const std::vector<AccuracyCase> cases = accuracy_cases();
  std::string text = "Problems:";
  for (const AccuracyCase& c : cases) {
    if (c.group.empty()) text += fmt::format("\n{}: {}", c.name, c.what);
  }
  std::set<std::string> groups;
  for (const AccuracyCase& c : cases) groups.insert(c.group);
  groups.erase("");
  for (const std::string& group : groups) {
    text += fmt::format("\nProblems of {0}, all of which \"{0}\" names:", group);
    for (const AccuracyCase& c : cases) {
      if (c.group == group) text += fmt::format("\n{}: {}", c.name, c.what);
    }
  }
  return text;
}

struct HardOptions {
  std::string device = "cpu";
  std::vector<std::string> precisions{"double", "mixed", "float"};
  std::vector<std::string> cases;
  bool include_long = false;
  TableOptions table;
};

/// Runs the hard cases. @returns true if all are good
bool measure_hard(const HardOptions& options) {
  const ChosenDevice device = choose_device(options.device);
  PrintedTable table(
      options.table,
      {"case", "precision", "wanted", "found", "error", "tolerance", "good", "seconds", "message"},
      device_facts(device));
  bool all_good = true;
  for (const HardCase& hard : hard_cases()) {
    const bool wanted =
        options.cases.empty() ||
        std::find(options.cases.begin(), options.cases.end(), hard.name) != options.cases.end();
    if (!wanted || (hard.is_long && !options.include_long)) continue;
    for (const std::string& name : options.precisions) {
      const Precision precision = *precision_named(name);
      if (hard.in_double && precision != Precision::double_) continue;
      const HardOutcome outcome = outcome_of(hard, {device, precision});
      all_good = all_good && outcome.good;
      table.row({hard.name, name, hard.tolerance > 0 ? "answer" : "refusal",
                 outcome.refused ? "refusal" : "answer",
                 outcome.refused ? "" : fmt::format("{:.2e}", outcome.error),
                 hard.tolerance > 0 ? fmt::format("{:g}", hard.tolerance) : "",
                 outcome.good ? "yes" : "no", fmt::format("{:.2f}", outcome.seconds),
                 outcome.message});
    }
  }
  return all_good;
}

}  // namespace

void add_accuracy(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "accuracy",
      "Solve problems with known answers on the CPU in double, and print errors and "
      "times");
  auto options = std::make_shared<AccuracyOptions>();
  command->add_option("cases", options->cases, listed_cases())->capture_default_str();
  command
      ->add_option("--across", options->across,
                   "Numbers of cells across the thinner sides "
                   "(default: those of each case)")
      ->delimiter(',')
      ->check(CLI::Range(2, 200));
  command
      ->add_option("--lattice", options->lattices,
                   "Placements of phyxels: nodes, cells, or mesh (on and in a surface)")
      ->delimiter(',')
      ->check(CLI::IsMember({"nodes", "cells", "mesh"}))
      ->capture_default_str();
  command
      ->add_option("--jitter", options->jitters,
                   "Largest random displacements of phyxels, in spacings (default: those of each "
                   "case, mostly 0 and 0.2)")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 0.5));
  command
      ->add_option("--factor", options->factors,
                   "Support radii, in mean distances to the ten nearest phyxels")
      ->delimiter(',')
      ->check(CLI::Range(1.0, 4.0))
      ->capture_default_str();
  command
      ->add_option("--hourglass", options->hourglass,
                   "Strengths of hourglass control (default: those of each case, mostly 0 and 0.1)")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 100.0));
  command
      ->add_option("--closure", options->closures,
                   "Tolerances of closed gradients; 0 for none "
                   "(default: those of each case, mostly 0 and "
                   "0.001)")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 1.0));
  add_table_options(*command, options->table);
  auto hard_options = std::make_shared<HardOptions>();
  CLI::App* hard = command->add_subcommand(
      "hard",
      "Solve cases that are hard to keep stable: each must be solved, or refused with its cause");
  std::string hard_names = "Cases (default: all):";
  for (const HardCase& c : hard_cases()) hard_names += fmt::format("\n{}: {}", c.name, c.what);
  hard->add_option("cases", hard_options->cases, hard_names);
  hard->add_option("--device", hard_options->device, device_help)->capture_default_str();
  hard->add_option("--precision", hard_options->precisions, "Precisions: double, mixed, float")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember({"double", "mixed", "float"}))
      ->capture_default_str();
  hard->add_flag("--long", hard_options->include_long, "Include cases that take minutes");
  add_table_options(*hard, hard_options->table);
  hard->footer(
      "Examples:\n"
      "  phyxel accuracy hard\n"
      "  phyxel accuracy hard \"three turns\" --precision double --device cuda");
  command->footer(
      "Examples:\n"
      "  phyxel accuracy tension gravity\n"
      "  phyxel accuracy bending --across 4,6,8 --lattice nodes,mesh --closure 0,1e-3\n"
      "  phyxel accuracy all --csv accuracy.csv");
  hard->callback([=] {
    if (!measure_hard(*hard_options)) {
      throw Error(ExitCode::diverged, "a case has failed (see the column \"good\")");
    }
  });
  command->callback([=] {
    if (command->get_subcommands().empty()) measure(*options);
  });
}

}  // namespace phyxel::app
