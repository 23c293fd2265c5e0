/// Cases of `phyxel accuracy` in tests.
#pragma once

#include <stdexcept>
#include <string>

#include "accuracy/accuracy.hpp"

namespace phyxel::testing {

/// Solves a case by its name. @throws std::runtime_error if there is none
inline app::Solution solved(const std::string& name, const app::Discretisation& d) {
  for (const app::AccuracyCase& c : app::accuracy_cases()) {
    if (c.name == name) return c.solve(d);
  }
  throw std::runtime_error(name);
}

/// The relative error of a quantity by its name. @throws std::runtime_error if there is none
inline double error_of(const app::Solution& solution, const std::string& quantity) {
  for (const app::Quantity& q : solution.found) {
    if (q.name == quantity) return q.error();
  }
  throw std::runtime_error(quantity);
}

}  // namespace phyxel::testing
