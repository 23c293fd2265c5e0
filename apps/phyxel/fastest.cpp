#include "fastest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace phyxel::app {
namespace {

/// Problem, quantity, lattice, factor, hourglass, closure, run, precision and safety.
using Key = std::vector<std::string>;
constexpr std::size_t problem = 0, quantity = 1, lattice = 2, run = 6;

/// Measurements of one key, by resolution, and how many problems they are of.
struct Family {
  std::map<int, Measured> measured;
  std::map<int, int> problems;

  /// The resolutions that all problems have, ascending.
  std::vector<Measured> common() const {
    int most = 0;
    for (const auto& [across, count] : problems) most = std::max(most, count);
    std::vector<Measured> all;
    for (const auto& [across, one] : measured) {
      if (problems.at(across) == most) all.push_back(one);
    }
    return all;
  }
};
using Families = std::map<Key, Family>;

/// Adds a measurement to its own family, and to that of the worst of all problems.
void add(Families& families, Key key, const Measured& one) {
  Family& own = families[key];
  if (!own.measured.try_emplace(one.across, one).second) return;  // at rest, each has several rows
  own.problems[one.across] = 1;
  key[problem] = "all";
  key[quantity] = "worst";
  Family& all = families[key];
  Measured& worst = all.measured.try_emplace(one.across, Measured{one.across, 0, 0}).first->second;
  worst.error = std::max(worst.error, std::abs(one.error));
  worst.seconds = std::max(worst.seconds, one.seconds);
  ++all.problems[one.across];
}

Families families_of(const CsvTable& table) {
  Families families;
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    Key key;
    for (const char* column :
         {"problem", "quantity", "lattice", "factor", "hourglass", "closure"}) {
      key.push_back(table.text(r, column));
    }
    const int across = static_cast<int>(table.number(r, "across"));
    const double error = table.number(r, "error");
    Key rest = key, steps = key;
    if (!table.text(r, "rest_seconds").empty()) {
      rest.insert(rest.end(), {"rest", "", ""});
      add(families, rest, {across, error, table.number(r, "rest_seconds")});
    }
    if (table.text(r, "precision").empty()) continue;
    steps.insert(steps.end(), {"steps", table.text(r, "precision"), table.text(r, "safety")});
    add(families, steps, {across, error, table.number(r, "seconds_per_simulated_second")});
  }
  return families;
}

}  // namespace

const std::vector<std::string>& error_columns() {
  static const std::vector<std::string> columns{"problem",
                                                "quantity",
                                                "lattice",
                                                "factor",
                                                "hourglass",
                                                "closure",
                                                "across",
                                                "phyxels",
                                                "neighbours",
                                                "error",
                                                "evaluations",
                                                "rest_seconds",
                                                "precision",
                                                "safety",
                                                "time_step_s",
                                                "step_seconds",
                                                "seconds_per_simulated_second"};
  return columns;
}

const std::vector<std::string>& fastest_columns() {
  static const std::vector<std::string> columns{
      "problem",   "quantity", "lattice",   "run",    "error_percent", "factor",
      "hourglass", "closure",  "precision", "safety", "across",        "seconds"};
  return columns;
}

std::vector<std::vector<std::string>> fastest_settings(const CsvTable& measured,
                                                       std::span<const double> levels) {
  using Where = std::tuple<std::string, std::string, std::string, std::string, double>;
  std::map<Where, std::pair<Key, Reached>> best;
  for (const auto& [key, family] : families_of(measured)) {
    const std::vector<Measured> resolutions = family.common();
    const bool is_one_of_one =
        key[problem] == "all" && family.problems.at(resolutions.front().across) < 2;
    if (is_one_of_one) continue;
    for (const double level : levels) {
      const std::optional<Reached> at = reach(resolutions, level / 100);
      if (!at) continue;
      const auto [found, is_new] =
          best.try_emplace({key[problem], key[quantity], key[lattice], key[run], -level}, key, *at);
      if (!is_new && at->seconds < found->second.second.seconds) found->second = {key, *at};
    }
  }
  std::vector<std::vector<std::string>> rows;
  for (const auto& [where, found] : best) {
    const auto& [key, at] = found;
    std::vector<std::string> row(key.begin(), key.begin() + lattice + 1);
    row.insert(row.end(), {key[run], fmt::format("{:g}", -std::get<double>(where))});
    row.insert(row.end(), key.begin() + lattice + 1, key.begin() + run);
    row.insert(row.end(), key.begin() + run + 1, key.end());
    row.insert(row.end(), {fmt::format("{:.3g}", at.across), fmt::format("{:.4g}", at.seconds)});
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<double> lasting_errors(std::span<const Measured> family) {
  std::vector<double> errors(family.size());
  double largest = 0;
  for (std::size_t k = family.size(); k-- > 0;) {
    const double error = std::abs(family[k].error);
    largest = std::isfinite(error) ? std::max(largest, error) : HUGE_VAL;
    errors[k] = largest;
  }
  return errors;
}

std::optional<Reached> reach(std::span<const Measured> family, double level) {
  const std::vector<double> errors = lasting_errors(family);
  const auto found =
      std::find_if(errors.begin(), errors.end(), [&](double error) { return error <= level; });
  const auto k = static_cast<std::size_t>(found - errors.begin());
  if (k + 1 >= family.size()) return std::nullopt;
  const Measured& fine = family[k];
  if (k == 0 || !std::isfinite(errors[k - 1]) || !(errors[k] > 0)) {
    return Reached{static_cast<double>(fine.across), fine.seconds};
  }
  const Measured& coarse = family[k - 1];
  const double share = std::log(errors[k - 1] / level) / std::log(errors[k - 1] / errors[k]);
  const auto between = [&](double from, double to) { return from * std::pow(to / from, share); };
  return Reached{between(coarse.across, fine.across), between(coarse.seconds, fine.seconds)};
}

}  // namespace phyxel::app
