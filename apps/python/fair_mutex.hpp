/// A mutex that threads get in the order in which they ask for it.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace phyxel::python {

/// A mutex for threads of which one asks again at once: with a `std::mutex`, others could wait for
/// ever.
class FairMutex {
 public:
  /// Waits for all threads that have asked before.
  void lock() {
    std::unique_lock guard(inside_);
    const std::uint64_t mine = asked_++;
    freed_.wait(guard, [&] { return served_ == mine; });
  }
  /// Takes the mutex if nobody has it or waits for it. @returns whether it did
  bool try_lock() {
    const std::lock_guard guard(inside_);
    if (asked_ != served_) return false;
    ++asked_;
    return true;
  }
  /// Passes the mutex on.
  void unlock() {
    const std::lock_guard guard(inside_);
    ++served_;
    freed_.notify_all();
  }

 private:
  std::mutex inside_;
  std::condition_variable freed_;
  std::uint64_t asked_ = 0, served_ = 0;
};

}  // namespace phyxel::python
