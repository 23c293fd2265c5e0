/// Studies of errors over one parameter: precision, step and support.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace phyxel::studies {

struct StudyRow {
  std::string way;  ///< "float", "verlet", ...
  double x = 0;     ///< The parameter.
  double error = 0;
  std::int64_t evaluations = 0;  ///< Number of evaluations of all forces.
  double seconds = 0;
};

struct Study {
  std::string name;
  std::string what;        ///< Description of the problem and of its error.
  std::string x, x_label;  ///< The parameter's name as a column and as an axis.
  bool by_time = false;    ///< True if its chart shows errors over seconds, not over x.
  /// Calls add(row) for each row as it is measured.
  void (*measure)(const std::function<void(const StudyRow&)>& add);
};
std::vector<Study> accuracy_studies();

}  // namespace phyxel::studies
