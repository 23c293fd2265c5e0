/// What the library refuses: pairs of values of two factors, from which the rows of the table keep
/// away. docs/combinations.md lists them with their reasons.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "support/pairs/combinations.hpp"

namespace phyxel::testing {

/// Values of two factors that the library refuses together.
struct Refusal {
  const char* what;  ///< In words.
  Factor first;
  std::vector<std::string> first_values;
  Factor second;
  std::vector<std::string> second_values;
  /// Key, value and what is allowed, as the error names them. "{precision}" and "{method}" stand for
  /// the values of these factors.
  std::vector<std::string> words;
  const char* reason;

  bool covers(const LevelPair& pair) const {
    return covers(pair.first, pair.first_level, pair.second, pair.second_level) ||
           covers(pair.second, pair.second_level, pair.first, pair.first_level);
  }

 private:
  bool covers(int f, int a, int g, int b) const {
    const auto has = [](const std::vector<std::string>& values, const std::string& value) {
      return std::find(values.begin(), values.end(), value) != values.end();
    };
    return f == first && g == second && has(first_values, value_name(f, a)) &&
           has(second_values, value_name(g, b));
  }
};

/// All pairs that are refused; every other pair is computed.
inline const std::vector<Refusal>& refusals() {
  static const std::vector<Refusal> all{
      {"a law of the caller's own on a GPU",
       law,
       {custom, custom_history},
       device,
       {by_tiles, in_residence},
       {"custom_law = \"", "cannot run on a GPU", "allowed is the CPU"},
       "it is C++ that the caller's program compiles for the CPU; a law for GPUs is a struct in the "
       "library (extending.md)"},
      {"implicit steps and equilibrium in float and mixed precision",
       method,
       {"implicit", "equilibrium"},
       precision,
       {"float", "mixed"},
       {"solver.precision = \"{precision}\"", "allowed with solver.method = \"{method}\": \"double\""},
       "Newton's method ends where residual forces are 1e-8 of what acts, and takes differences of "
       "forces; forces in float are rounded to 6e-8 of themselves, and residuals stay above 1e-8"},
      {"hourglass control with adaptive supports or `max_neighbours`",
       hourglass,
       {"hourglass control"},
       supports,
       {"adaptive supports", "capped lists"},
       {"hourglass control (0.1)", "allowed are neighbours.support = \"uniform\"", "hourglass = 0"},
       "its force is derived for lists and weights that are the same from both sides; others need "
       "one more sum over the inverse lists, which is not written"},
      {"closed gradients with adaptive supports or `max_neighbours`",
       closure,
       {"closed gradients"},
       supports,
       {"adaptive supports", "capped lists"},
       {"closed gradients (0.001)", "allowed are neighbours.support = \"uniform\"", "closure = 0"},
       "closing vectors and their forces are derived for lists and weights that are the same from "
       "both sides; others need one more sum over the inverse lists, which is not written"}};
  return all;
}

/// The refusal of a pair; null if it is computed.
inline const Refusal* refusal_of_pair(const LevelPair& pair) {
  for (const Refusal& refusal : refusals()) {
    if (refusal.covers(pair)) return &refusal;
  }
  return nullptr;
}

/// A line of the table in docs/combinations.md.
inline std::string table_line(const std::string& what, const std::vector<std::string>& words,
                              const std::string& reason) {
  std::string says;
  for (const std::string& part : words) says += (says.empty() ? "`" : " … `") + part + "`";
  return "| " + what + " | " + says + " | " + reason + " |";
}

/// The rows of one device: every pair of values of the other factors, and each of them on that
/// device, but for those that are refused.
inline std::vector<Combination> rows_on(const std::string& device_name) {
  const int here = level_of(device, device_name);
  const auto allowed = [&](const LevelPair& pair) {
    const bool elsewhere = pair.first == device && pair.first_level != here;
    return !elsewhere && !refusal_of_pair(pair);
  };
  // Pairs of values that the device itself excludes occur in no row.
  const Covering covering(level_counts(), [&](const LevelPair& pair) {
    if (!allowed(pair)) return false;
    for (const auto& [factor, level] :
         {std::pair{pair.first, pair.first_level}, std::pair{pair.second, pair.second_level}}) {
      if (factor != device && !allowed({device, here, factor, level})) return false;
    }
    return true;
  });
  std::vector<Combination> rows;
  for (const Levels& levels : covering.rows()) {
    rows.push_back({levels, static_cast<int>(rows.size()) + 1});
  }
  return rows;
}

}  // namespace phyxel::testing
