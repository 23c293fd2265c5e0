/// What a scene combines: laws, terms, boundaries, devices, precisions and methods, as factors with
/// values, and the rows of a table of them.
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
  pair_terms,
  inclusions,
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
inline constexpr const char *hourglass = "hourglass control", *closed = "closed gradients",
                            *hourglass_and_closed = "hourglass control and closed gradients";
inline constexpr const char *custom = "custom law", *custom_history = "custom law with history";

/// All factors. Laws are those of `law_table()`, and two of a caller's own. Pair terms are one
/// factor, so that each combination of them meets each value of the others.
inline const std::vector<FactorEntry>& factors() {
  static const std::vector<FactorEntry> all = [] {
    std::vector<std::string> laws;
    for (const LawEntry& entry : law_table()) laws.emplace_back(entry.name);
    laws.insert(laws.end(), {custom, custom_history});
    return std::vector<FactorEntry>{
        {"device", {on_cpu, by_tiles, in_residence}},
        {"law", laws},
        {"pair terms", {"", hourglass, closed, hourglass_and_closed}},
        {"inclusions", {"", "inclusions"}},
        {"volume", {"", "volume conservation"}},
        {"viscosity", {"", "viscosity"}},
        {"damping", {"", "damping"}},
        {"external", {"", "external forces"}},
        {"boundary", {"free", "fixed", "rollers", "moved", "loaded", "growing loads", "pressure"}},
        {"supports", {"one support", "adaptive supports", "capped lists", "supports of pairs"}},
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

/// "law = j2 with pair terms = closed gradients"
inline std::string describe(const LevelPair& pair) {
  const auto one = [](int factor, int level) {
    const std::string& value = value_name(factor, level);
    return std::string(factors()[factor].name) + " = " + (value.empty() ? "none" : value);
  };
  return one(pair.first, pair.first_level) + " with " + one(pair.second, pair.second_level);
}

/// A row of the table: one value of every factor.
struct Combination {
  Levels levels;
  int number = 0;

  const std::string& value(Factor factor) const { return value_name(factor, levels[factor]); }
  bool is(Factor factor, const std::string& wanted) const { return value(factor) == wanted; }
  /// True if a term is in use.
  bool has(Factor term) const { return levels[term] > 0; }
  bool has_hourglass() const {
    return is(pair_terms, hourglass) || is(pair_terms, hourglass_and_closed);
  }
  bool is_closed() const { return is(pair_terms, closed) || is(pair_terms, hourglass_and_closed); }
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
