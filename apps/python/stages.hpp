/// Progress of set-ups and runs for Python.
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>
#include <cmath>
#include <utility>

#include "phyxel/progress.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::python {

namespace py = pybind11;

/// An observer that calls `progress(stage, share)` at the beginning and the end of stages, and at
/// most ten times a second in between, and that reacts to Ctrl-C. It throws py::error_already_set.
/// @param progress must outlive the observer; None to react to Ctrl-C only
inline StageObserver observer_for(const py::object& progress) {
  using Clock = std::chrono::steady_clock;
  return [&progress, last = Clock::time_point()](std::string_view stage, double share) mutable {
    const auto now = Clock::now();
    const bool between = share > 0 && share < 1;
    if (between && now - last < std::chrono::milliseconds(100)) return;
    last = now;
    const py::gil_scoped_acquire here;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (!progress.is_none()) progress(py::str(stage.data(), stage.size()), share);
  };
}

/// A scope in which `progress` is called for the stages of set-ups on this thread.
inline ObserveStages stages_for(const py::object& progress) {
  return ObserveStages(observer_for(progress));
}

/// Progress of a run, reported to a callback.
class RunProgress {
 public:
  /// Scope of a run, which is one stage. @param begin,end times of the first and the last state [s]
  class Scope {
   public:
    Scope(RunProgress& told, const py::object& progress, Method method, double begin, double end)
        : told_(told) {
      if (progress.is_none()) return;
      told_ = {observer_for(progress), method == Method::equilibrium, begin, end};
      told_.heard_(told_.stage(), 0);
    }
    ~Scope() { told_ = {}; }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    RunProgress& told_;
  };

  RunProgress() = default;
  /// Reports a simulated time [s]. @throws py::error_already_set
  void reach_time(double time) {
    if (!searches_) reach((time - begin_) / (end_ - begin_));
  }
  /// Reports the residual of a search for equilibrium, which falls by a similar factor in each
  /// Newton step. @throws py::error_already_set
  void reach_residual(double residual, double tolerance) {
    if (searches_) reach(std::log(residual) / std::log(tolerance));
  }
  /// Reports the end. @throws py::error_already_set
  void end() {
    if (heard_) heard_(stage(), 1);
  }

 private:
  RunProgress(StageObserver heard, bool searches, double begin, double end)
      : heard_(std::move(heard)), searches_(searches), begin_(begin), end_(end) {}

  const char* stage() const { return searches_ ? "search for rest" : "steps"; }
  /// Reports a share; smaller values than before, and NaN, are ignored.
  void reach(double share) {
    if (!heard_ || !(share > told_) || !(share < 1)) return;
    told_ = share;
    heard_(stage(), share);
  }

  StageObserver heard_;  // empty without a callback
  bool searches_ = false;
  double begin_ = 0, end_ = 0, told_ = 0;
};

}  // namespace phyxel::python
