#include "stage.hpp"

#include <algorithm>
#include <utility>

namespace phyxel {
namespace {

/// The observer of this thread; null on other threads, as those of a parallel region.
thread_local const StageObserver* heard_by = nullptr;

}  // namespace

ObserveStages::ObserveStages(StageObserver observer)
    : observer_(std::move(observer)), before_(heard_by) {
  heard_by = observer_ ? &observer_ : nullptr;
}

ObserveStages::~ObserveStages() { heard_by = before_; }

Stage::Stage(const char* name) : phase_(name), name_(name), observer_(heard_by) {
  if (observer_) (*observer_)(name_, 0);
}

void Stage::reach(double share) {
  if (!observer_) return;
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  if (!(share > reached_)) return;
  reached_ = std::min(share, 1.0);
  (*observer_)(name_, reached_);
}

void Stage::expect(std::size_t parts) {
  parts_ = std::max<std::size_t>(1, parts);
  counted_ = 0;
  from_ = reached_;
}

void Stage::count() {
  if (!observer_) return;
  const std::size_t counted = ++counted_;
  // The observer's thread is the first one of a parallel region, and takes part in its loops.
  if (heard_by != observer_ || error_ || counted >= parts_) return;
  try {
    reach(from_ + (1 - from_) * static_cast<double>(counted) / static_cast<double>(parts_));
  } catch (...) {
    error_ = std::current_exception();
  }
}

}  // namespace phyxel
