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
  /// Key, value and what is allowed, as the error names them. "{precision}" and "{method}" stand
  /// for the values of these factors.
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
       "a caller's law is C++ that the caller's program compiles for the CPU; a law for GPUs is "
       "a struct in the library (extending.md)"},
      {"implicit steps and equilibrium in float and mixed precision",
       method,
       {"implicit", "equilibrium"},
       precision,
       {"float", "mixed"},
       {"solver.precision = \"{precision}\"",
        "allowed with solver.method = \"{method}\": \"double\""},
       "Newton's method ends where residual forces are 1e-8 of what acts, and takes differences "
       "of forces; forces in float are rounded to 6e-8 of themselves, and residuals stay above "
       "1e-8"},
      {"hourglass control with adaptive supports or `max_neighbours`",
       pair_terms,
       {hourglass, hourglass_and_closed},
       supports,
       {"adaptive supports", "capped lists"},
       {"hourglass control (0.1)", "allowed are neighbours.support = \"uniform\"", "hourglass = 0"},
       "the force of hourglass control is derived for lists and weights that are the same from "
       "both sides; others need one more sum over the inverse lists, which is not written"},
      {"closed gradients with adaptive supports or `max_neighbours`",
       pair_terms,
       {closed},
       supports,
       {"adaptive supports", "capped lists"},
       {"closed gradients (0.001)", "allowed are neighbours.support = \"uniform\"", "closure = 0"},
       "closing vectors and their forces are derived for lists and weights that are the same "
       "from both sides; others need one more sum over the inverse lists, which is not written"}};
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

/// A precision with a method that takes it.
struct Mode {
  int precision_level, method_level;
};
inline std::vector<Mode> all_modes() {
  std::vector<Mode> modes;
  const std::vector<int> counts = level_counts();
  for (int p = 0; p < counts[precision]; ++p) {
    for (int m = 0; m < counts[method]; ++m) {
      if (!refusal_of_pair({precision, p, method, m})) modes.push_back({p, m});
    }
  }
  return modes;
}

/// The rows of one device: every pair of values of the other factors that is not refused. Precision
/// and method are covered as one factor, so that each value of another meets each precision of each
/// method.
inline std::vector<Combination> rows_on(const std::string& device_name) {
  static_assert(precision == factor_count - 2 && method == factor_count - 1);
  const std::vector<Mode> modes = all_modes();
  const int here = level_of(device, device_name);
  std::vector<int> counts = level_counts();
  counts[precision] = static_cast<int>(modes.size());
  counts.pop_back();
  /// Calls each(factor, level) for the values that a value of the array stands for.
  const auto for_values = [&](int factor, int level, auto&& each) {
    if (factor != precision) return each(factor, level);
    each(precision, modes[level].precision_level);
    each(method, modes[level].method_level);
  };
  const Covering covering(counts, [&](const LevelPair& pair) {
    bool allowed = pair.first != device || pair.first_level == here;
    for_values(pair.first, pair.first_level, [&](int f, int a) {
      allowed = allowed && (f == device || !refusal_of_pair({device, here, f, a}));
      for_values(pair.second, pair.second_level, [&](int g, int b) {
        allowed =
            allowed && !refusal_of_pair({f, a, g, b}) && !refusal_of_pair({device, here, g, b});
      });
    });
    return allowed;
  });
  std::vector<Combination> rows;
  for (Levels levels : covering.rows()) {
    const Mode mode = modes[levels[precision]];
    levels[precision] = mode.precision_level;
    levels.push_back(mode.method_level);
    rows.push_back({levels, static_cast<int>(rows.size()) + 1});
  }
  return rows;
}

}  // namespace phyxel::testing
