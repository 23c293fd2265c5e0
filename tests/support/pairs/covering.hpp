/// Covering arrays of strength two: a few rows of factor values in which every pair of values of
/// two factors occurs.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <stdexcept>
#include <vector>

namespace phyxel::testing {

/// One value, as an index, for each factor.
using Levels = std::vector<int>;

/// A pair of values of two factors, `first` < `second`.
struct LevelPair {
  int first, first_level, second, second_level;
  bool operator==(const LevelPair&) const = default;
};

/// All pairs of values of factors with the given numbers of values.
inline std::vector<LevelPair> all_pairs(const std::vector<int>& levels) {
  std::vector<LevelPair> pairs;
  const int factors = static_cast<int>(levels.size());
  for (int f = 0; f < factors; ++f) {
    for (int g = f + 1; g < factors; ++g) {
      for (int a = 0; a < levels[f]; ++a) {
        for (int b = 0; b < levels[g]; ++b) pairs.push_back({f, a, g, b});
      }
    }
  }
  return pairs;
}

/// True if a row contains a pair.
inline bool contains(const Levels& row, const LevelPair& pair) {
  return row[pair.first] == pair.first_level && row[pair.second] == pair.second_level;
}

/// A greedy covering array. Each row starts with the first pair that is still uncovered; every
/// other factor, those with the most values first, takes the allowed value that completes the most
/// uncovered pairs, and of several such values one that depends on the row's number. The result is
/// a function of the arguments alone.
class Covering {
 public:
  /// @param levels number of values of each factor. @param allowed false for a refused pair
  Covering(std::vector<int> levels, std::function<bool(const LevelPair&)> allowed)
      : levels_(std::move(levels)), allowed_(std::move(allowed)) {
    for (const LevelPair& pair : all_pairs(levels_)) {
      if (allowed_(pair)) uncovered_.push_back(pair);
    }
    for (int f = 0; f < static_cast<int>(levels_.size()); ++f) order_.push_back(f);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](int f, int g) { return levels_[f] > levels_[g]; });
    while (!uncovered_.empty()) add_row();
  }
  const std::vector<Levels>& rows() const { return rows_; }

 private:
  static constexpr int unset = -1;

  LevelPair pair_of(int f, int a, int g, int b) const {
    return f < g ? LevelPair{f, a, g, b} : LevelPair{g, b, f, a};
  }
  bool fits(const Levels& row, int factor, int level) const {
    for (int g = 0; g < static_cast<int>(row.size()); ++g) {
      if (g == factor || row[g] == unset) continue;
      if (!allowed_(pair_of(factor, level, g, row[g]))) return false;
    }
    return true;
  }
  /// Number of uncovered pairs that a value completes.
  int gain(const Levels& row, int factor, int level) const {
    int gained = 0;
    for (const LevelPair& pair : uncovered_) {
      if (pair.first == factor && pair.first_level == level) {
        gained += row[pair.second] == pair.second_level;
      } else if (pair.second == factor && pair.second_level == level) {
        gained += row[pair.first] == pair.first_level;
      }
    }
    return gained;
  }
  void add_row() {
    Levels row(levels_.size(), unset);
    row[uncovered_[0].first] = uncovered_[0].first_level;
    row[uncovered_[0].second] = uncovered_[0].second_level;
    for (const int factor : order_) {
      if (row[factor] != unset) continue;
      int best = unset, most = -1;
      for (int k = 0; k < levels_[factor]; ++k) {
        const int level = (k + static_cast<int>(rows_.size())) % levels_[factor];
        if (!fits(row, factor, level)) continue;
        const int gained = gain(row, factor, level);
        if (gained > most) best = level, most = gained;
      }
      if (best == unset) throw std::logic_error("no value of a factor is allowed with the others");
      row[factor] = best;
    }
    std::erase_if(uncovered_, [&](const LevelPair& pair) { return contains(row, pair); });
    rows_.push_back(row);
  }

  std::vector<int> levels_;
  std::function<bool(const LevelPair&)> allowed_;
  std::vector<LevelPair> uncovered_;
  std::vector<int> order_;
  std::vector<Levels> rows_;
};

}  // namespace phyxel::testing
