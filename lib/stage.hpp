/// Stages of a set-up, reported to observers and profiles.
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <type_traits>

#include "phyxel/progress.hpp"
#include "timeline.hpp"

namespace phyxel {

/// A stage of a set-up. Its progress is reported to this thread's observer, and its span to the
/// profile.
class Stage {
 public:
  /// Begins the stage. @param name must live as long as the program
  explicit Stage(const char* name);
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  /// Reports the share that is done; smaller values than before, and NaN, are ignored. Not for
  /// parallel regions. @throws what the observer throws
  void reach(double share);
  /// Announces `parts` calls of `count`, which bring the stage to its end.
  void expect(std::size_t parts);
  /// Reports one more part, also in parallel regions: an exception of the observer is thrown by the
  /// next call of `reach` or `finish`.
  void count();
  /// Reports the end; the destructor does not. @throws what the observer throws
  void finish() {
    reach(1);
    phase_.end();
  }

 private:
  Phase phase_;
  const char* name_;
  const StageObserver* observer_;  // may be null
  double reached_ = 0, from_ = 0;
  std::size_t parts_ = 1;
  std::atomic<std::size_t> counted_ = 0;
  std::exception_ptr error_;
};

/// Returns `work()`, run as a stage.
template <class Work>
auto in_stage(const char* name, Work&& work) {
  Stage stage(name);
  if constexpr (std::is_void_v<decltype(work())>) {
    work();
    stage.finish();
  } else {
    auto made = work();
    stage.finish();
    return made;
  }
}

}  // namespace phyxel
