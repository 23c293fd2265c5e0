/// What precision and what steps a scene needs: errors over one number at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace phyxel::studies {

struct StudyRow {
  std::string way;  ///< "float", "verlet", ...
  double x = 0;     ///< What the study goes over.
  double error = 0;
  std::int64_t evaluations = 0;  ///< Of all phyxels' forces.
  double seconds = 0;
};

struct Study {
  std::string name;
  std::string what;        ///< The problem and what its error is measured by.
  std::string x, x_label;  ///< What it goes over: a column's name, an axis's.
  bool by_time = false;    ///< Its chart is of errors over seconds, not over x.
  /// Calls add(row) for each as it is found.
  void (*measure)(const std::function<void(const StudyRow&)>& add);
};
std::vector<Study> accuracy_studies();

}  // namespace phyxel::studies
