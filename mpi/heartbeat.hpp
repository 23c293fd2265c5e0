/// The heartbeat of a rank, in memory that the ranks of its host share.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

namespace phyxel {

struct Heartbeat {
  std::atomic<std::int64_t> step{0};
  std::atomic<std::int64_t> since{0};      ///< Time of the last change, by the steady clock [ns].
  std::atomic<std::int64_t> watching{0};   ///< Time of its watchdog's last check [ns].
  std::atomic<std::int64_t> named_at{-1};  ///< Last step for which the rank was reported.
  std::atomic<int> waiting{0};             ///< 1 while it waits for other ranks, else 0.
  std::atomic<int> ended{0};

  static std::int64_t now() {
    return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
  }
};
static_assert(std::atomic<std::int64_t>::is_always_lock_free);  // required between processes

/// The heartbeat of this rank; null while there is no watchdog.
extern std::atomic<Heartbeat*> own_heartbeat;

/// Scope in which this rank is marked as waiting for others.
class Waiting {
 public:
  Waiting() { mark(1); }
  ~Waiting() { mark(0); }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

 private:
  static void mark(int waiting) {
    Heartbeat* const beat = own_heartbeat;
    if (!beat) return;
    beat->since = Heartbeat::now();
    beat->waiting = waiting;
  }
};

}  // namespace phyxel
