/// The stages of a set-up, as the library tells of them.
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <type_traits>

#include "phyxel/progress.hpp"
#include "timeline.hpp"

namespace phyxel {

/// A stage of a set-up, which this thread's observer hears of and a profile shows.
class Stage {
 public:
  /// @param name lives as long as the program
  explicit Stage(const char* name);
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  /// Tells that so much is done; less than was told before, or NaN, is passed over. Not for
  /// parallel regions. @throws what the observer throws
  void reach(double share);
  /// The next `parts` calls of `count` bring the stage from where it is to its end.
  void expect(std::size_t parts);
  /// One more part is done. For parallel regions, too: an exception of the observer waits for the
  /// next call of `reach` or `finish`.
  void count();
  /// Tells the end. @throws what the observer throws
  void finish() { reach(1); }

 private:
  const Phase phase_;
  const char* name_;
  const StageObserver* observer_;  // null: nobody
  double reached_ = 0, from_ = 0;
  std::size_t parts_ = 1;
  std::atomic<std::size_t> counted_ = 0;
  std::exception_ptr error_;
};

/// `work()` as a stage.
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
