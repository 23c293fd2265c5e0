/// What a scene combines: laws, terms, boundaries, devices, precisions and methods, as factors with
/// values, and the pairs of values that the library refuses.
#pragma once

#include <algorithm>
#include <cctype>
#include <ostream>
#include <string>
#include <vector>

#include "phyxel/law_table.hpp"
#include "phyxel/scene.hpp"
#include "support/pairs/covering.hpp"

namespace phyxel::testing {

/// The factors, in the order of `factors()`.
enum Factor {
  device,
  law,
  closure,
  inclusions,
  hourglass,
  volume,
  viscosity,
  damping,
  external,
  boundary,
  supports,
  cloud,
  precision,
  method,
  factor_count
};

/// A factor and the names of its values. The first value is the plain one.
struct FactorEntry {
  const char* name;
  std::vector<std::string> values;
};

inline constexpr const char *on_cpu = "cpu", *by_tiles = "GPU by tiles",
                            *in_residence = "GPU in residence";
inline constexpr const char *custom = "custom law", *custom_history = "custom law with history";

/// All factors. Laws are those of `law_table()`, and two of a caller's own.
inline const std::vector<FactorEntry>& factors() {
  static const std::vector<FactorEntry> all = [] {
    std::vector<std::string> laws;
    for (const LawEntry& entry : law_table()) laws.emplace_back(entry.name);
    laws.insert(laws.end(), {custom, custom_history});
    return std::vector<FactorEntry>{
        {"device", {on_cpu, by_tiles, in_residence}},
        {"law", laws},
        {"closure", {"", "closed gradients"}},
        {"inclusions", {"", "inclusions"}},
        {"hourglass", {"", "hourglass control"}},
        {"volume", {"", "volume conservation"}},
        {"viscosity", {"", "viscosity"}},
        {"damping", {"", "damping"}},
        {"external", {"", "external forces"}},
        {"boundary", {"free", "fixed", "rollers", "moved", "loaded"}},
        {"supports", {"one support", "adaptive supports", "capped lists"}},
        {"cloud", {"lattice", "jittered lattice", "filled mesh"}},
        {"precision", {"float", "double", "mixed"}},
        {"method", {"verlet", "implicit", "equilibrium"}}};
  }();
  return all;
}

/// Number of values of each factor.
inline std::vector<int> level_counts() {
  std::vector<int> counts;
  for (const FactorEntry& factor : factors())
    counts.push_back(static_cast<int>(factor.values.size()));
  return counts;
}

inline const std::string& value_name(int factor, int level) {
  return factors()[factor].values[level];
}

/// "law = j2 with closure = closed gradients"
inline std::string describe(const LevelPair& pair) {
  const auto one = [](int factor, int level) {
    const std::string& value = value_name(factor, level);
    return std::string(factors()[factor].name) + " = " + (value.empty() ? "none" : value);
  };
  return one(pair.first, pair.first_level) + " with " + one(pair.second, pair.second_level);
}

/// Values of two factors that the library refuses together.
struct Refusal {
  Factor first;
  std::vector<std::string> first_values;
  Factor second;
  std::vector<std::string> second_values;
  std::vector<std::string> words;  ///< Key, value and what is allowed, as the error names them.
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
      {law,
       {custom, custom_history},
       device,
       {by_tiles, in_residence},
       {"custom_law = \"", "cannot run on a GPU", "allowed is the CPU"},
       "it is C++ of the caller's program, compiled for the CPU; a law that shall run on GPUs is a "
       "struct in the library (docs/extending.md)"},
      {method,
       {"implicit", "equilibrium"},
       precision,
       {"float", "mixed"},
       {"solver.precision = \"", "solver.method = \"", "allowed", "\"double\""},
       "Newton's method takes differences of forces over 1e-7 of a support, and ends at a residual "
       "of 1e-8 of what acts: forces in float are rounded to 1e-7 of themselves"},
      {hourglass,
       {"hourglass control"},
       supports,
       {"adaptive supports", "capped lists"},
       {"hourglass control (0.1)", "allowed are neighbours.support = \"uniform\"", "hourglass = 0"},
       "its energy counts each pair of neighbours from both sides with one weight, which needs "
       "lists that are symmetric"},
      {closure,
       {"closed gradients"},
       supports,
       {"adaptive supports", "capped lists"},
       {"closed gradients (0.001)", "allowed are neighbours.support = \"uniform\"", "closure = 0"},
       "the integration constraint is a sum over symmetric lists with one weight for each pair"}};
  return all;
}

/// The refusal of a pair; null if it is computed.
inline const Refusal* refusal_of_pair(const LevelPair& pair) {
  for (const Refusal& refusal : refusals()) {
    if (refusal.covers(pair)) return &refusal;
  }
  return nullptr;
}

/// A row of the table: one value of every factor.
struct Combination {
  Levels levels;
  int number = 0;

  const std::string& value(Factor factor) const { return value_name(factor, levels[factor]); }
  bool is(Factor factor, const std::string& wanted) const { return value(factor) == wanted; }
  /// True if a term is in use.
  bool has(Factor term) const { return levels[term] > 0; }
  bool on_gpu() const { return !is(device, on_cpu); }
  Precision working_precision() const { return *precision_named(value(precision)); }
  Method time_method() const { return *method_named(value(method)); }
  /// All values that are named, in words.
  std::string describe() const {
    std::string words;
    for (int f = 0; f < factor_count; ++f) {
      const std::string& value = value_name(f, levels[f]);
      if (!value.empty()) words += (words.empty() ? "" : ", ") + value;
    }
    return words;
  }
};
inline void PrintTo(const Combination& row, std::ostream* out) { *out << row.describe(); }

/// The level of a value of a factor.
inline int level_of(Factor factor, const std::string& value) {
  const std::vector<std::string>& values = factors()[factor].values;
  return static_cast<int>(std::find(values.begin(), values.end(), value) - values.begin());
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

/// "Row07_NeoHookeanFixedDoubleImplicit", for names of tests.
inline std::string test_name(const Combination& row) {
  std::string name = (row.number < 10 ? "Row0" : "Row") + std::to_string(row.number) + "_";
  for (const Factor factor : {law, boundary, precision, method}) {
    bool begins = true;
    for (const char c : row.value(factor)) {
      if (!std::isalnum(static_cast<unsigned char>(c))) {
        begins = true;
        continue;
      }
      name += begins ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
      begins = false;
    }
  }
  return name;
}

}  // namespace phyxel::testing
