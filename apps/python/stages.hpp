/// Stages of a set-up, as Python hears of them.
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>

#include "phyxel/progress.hpp"

namespace phyxel::python {

namespace py = pybind11;

/// While the observer lives, `progress(stage, share)` is called for the stages of this thread's
/// set-up, ten times a second at most but for their beginnings and ends, and Ctrl-C is heard.
/// @param progress None: Ctrl-C alone
/// @throws py::error_already_set out of the set-up
inline ObserveStages stages_for(const py::object& progress) {
  using Clock = std::chrono::steady_clock;
  return ObserveStages(
      [&progress, last = Clock::time_point()](std::string_view stage, double share) mutable {
        const auto now = Clock::now();
        const bool between = share > 0 && share < 1;
        if (between && now - last < std::chrono::milliseconds(100)) return;
        last = now;
        const py::gil_scoped_acquire here;
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        if (!progress.is_none()) progress(py::str(stage.data(), stage.size()), share);
      });
}

}  // namespace phyxel::python
