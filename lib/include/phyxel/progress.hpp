/// Progress of a set-up, for programs that display it.
#pragma once

#include <functional>
#include <string_view>

namespace phyxel {

/// Callback for the progress of one stage of a set-up: `share` is 0 at the beginning of the stage,
/// grows, and is 1 at its end. It is called on the thread that sets up. An exception that it throws
/// ends the set-up and reaches its caller; of ranks that set up a model together, all must throw it
/// or none.
using StageObserver = std::function<void(std::string_view stage, double share)>;

/// Registers an observer for its own lifetime; the observer is called for all stages of set-ups on
/// this thread: meshes read and filled, neighbours, moments, closed gradients, shares of ranks, the
/// arrays of a solver, the largest step. Each thread has its own observers, so that threads can set
/// up models at the same time. The last observer constructed is called. Without an observer, a
/// stage costs a comparison.
class ObserveStages {
 public:
  /// @param observer an empty one turns reports off
  explicit ObserveStages(StageObserver observer);
  ~ObserveStages();
  ObserveStages(const ObserveStages&) = delete;
  ObserveStages& operator=(const ObserveStages&) = delete;

 private:
  StageObserver observer_;
  const StageObserver* before_;
};

}  // namespace phyxel
