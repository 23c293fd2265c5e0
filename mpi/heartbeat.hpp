/// The heartbeat of a rank: how far it has come, in memory that the ranks of its host share.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

namespace phyxel {

struct Heartbeat {
  std::atomic<std::int64_t> step{0};
  std::atomic<std::int64_t> since{0};     ///< [ns], by the host's steady clock: of the last change.
  std::atomic<std::int64_t> watching{0};  ///< The same: when its watchdog last looked.
  std::atomic<std::int64_t> named_at{-1};  ///< The last step that it was named for.
  std::atomic<int> waiting{0};             ///< Whether it waits for other ranks.
  std::atomic<int> ended{0};

  static std::int64_t now() {
    return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
  }
};
static_assert(std::atomic<std::int64_t>::is_always_lock_free);  // or processes could not share it

/// The heartbeat of this rank; null while nobody watches.
extern std::atomic<Heartbeat*> own_heartbeat;

/// Marks this rank as waiting for others, as long as the object lives.
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
