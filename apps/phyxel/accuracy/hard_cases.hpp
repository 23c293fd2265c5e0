/// Cases that are hard to keep stable or accurate: each is answered or refused with its cause.
#pragma once

#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/device.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// The machine of a case.
struct Machine {
  ChosenDevice device;
  Precision precision = Precision::double_;
};

struct HardCase {
  std::string name;
  std::string what;        ///< Description of the case and of its error.
  double tolerance = 0;    ///< Largest error; 0 if the case must be refused.
  bool in_double = false;  ///< True if Newton's method solves the case, in double.
  bool is_long = false;    ///< True if it takes minutes.
  /// Runs the case. @returns its error @throws Error to refuse it
  double (*error)(const Machine&);
};

std::vector<HardCase> hard_cases();

struct HardOutcome {
  bool refused = false;
  double error = 0;
  std::string message;  ///< Message of the refusal.
  double seconds = 0;
  /// True if the error is within the tolerance, or if the case was refused as it must be.
  bool good = false;
};
HardOutcome outcome_of(const HardCase& hard, const Machine& machine);

}  // namespace phyxel::app
