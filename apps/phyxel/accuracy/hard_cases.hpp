/// Cases that are hard to keep stable or accurate: each is answered or refused with its cause.
#pragma once

#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/device.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// What a case is run on.
struct Machine {
  ChosenDevice device;
  Precision precision = Precision::double_;
};

struct HardCase {
  std::string name;
  std::string what;        ///< The case, and what its error is measured by.
  double tolerance = 0;    ///< Of the error; 0: the case is to be refused.
  bool in_double = false;  ///< Newton's method finds it, which computes in double.
  bool is_long = false;    ///< Minutes.
  /// @returns its error. @throws Error to refuse it
  double (*error)(const Machine&);
};

std::vector<HardCase> hard_cases();

struct HardOutcome {
  bool refused = false;
  double error = 0;
  std::string message;  ///< Of the refusal.
  double seconds = 0;
  /// As the case asks: never NaN, never another error.
  bool good = false;
};
HardOutcome outcome_of(const HardCase& hard, const Machine& machine);

}  // namespace phyxel::app
