#include "mpi/watchdog.hpp"

#include <fmt/format.h>
#include <mpi.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <new>
#include <thread>
#include <vector>

#include "mpi/heartbeat.hpp"
#include "mpi/native.hpp"
#include "terminal.hpp"

namespace phyxel {

std::atomic<Heartbeat*> own_heartbeat{nullptr};

struct Watchdog::SharedHeartbeats {
  SharedHeartbeats(const MpiCommunicator& ranks, double seconds)
      : limit(seconds), all(ranks.size()) {
    MPI_Comm_split_type(ranks.native()->all, MPI_COMM_TYPE_SHARED, ranks.rank(), MPI_INFO_NULL,
                        &host);
    void* memory = nullptr;
    MPI_Win_allocate_shared(sizeof(Heartbeat), 1, MPI_INFO_NULL, host, &memory, &window);
    own = new (memory) Heartbeat;
    own->since = own->watching = Heartbeat::now();
    MPI_Barrier(host);
    for (int r = 0; r < ranks.size(); ++r) {
      if (ranks.host_of(r) != ranks.host_of(ranks.rank())) continue;
      MPI_Aint bytes = 0;
      int unit = 0;
      MPI_Win_shared_query(window, static_cast<int>(beats.size()), &bytes, &unit, &memory);
      beats.push_back(static_cast<Heartbeat*>(memory));
      numbers.push_back(r);
    }
    own_heartbeat = own;
    thread = std::thread([this] { watch(); });
  }
  /// Local: other ranks may still read this rank's memory, which lives until MPI ends.
  ~SharedHeartbeats() { stop(); }
  /// Ends the watch and releases the shared memory. Collective.
  void close() {
    stop();
    MPI_Win_free(&window);
    MPI_Comm_free(&host);
  }

  void stop() {
    if (!thread.joinable()) return;
    own_heartbeat = nullptr;
    own->ended = 1;
    {
      const std::lock_guard lock(mutex);
      leave = true;
    }
    changed.notify_all();
    thread.join();
  }

  void watch() {
    const auto pause = std::chrono::duration<double>(std::clamp(limit / 4, 0.05, 1.0));
    std::unique_lock lock(mutex);
    while (!changed.wait_for(lock, pause, [&] { return leave; })) {
      const std::int64_t now = Heartbeat::now();
      const std::int64_t last_look = own->watching.exchange(now);
      if (1e-9 * static_cast<double>(now - last_look) > limit) continue;  // this rank was suspended
      // The first rank whose thread is awake reports.
      const auto awake = [&](const Heartbeat* p) {
        return p == own || (!p->ended && 1e-9 * static_cast<double>(now - p->watching) < limit);
      };
      if (*std::find_if(beats.begin(), beats.end(), awake) != own) continue;
      for (std::size_t k = 0; k < beats.size(); ++k) look_at(k, now);
    }
  }
  void look_at(std::size_t k, std::int64_t now) {
    Heartbeat& beat = *beats[k];
    // The thread of a waiting rank still runs, unless its process was stopped or its host is
    // overloaded.
    const std::int64_t last = beat.waiting ? beat.watching : beat.since;
    const double still = 1e-9 * static_cast<double>(now - last);
    const std::int64_t step = beat.step;
    if (beat.ended || still < limit || beat.named_at.exchange(step) == step) return;
    fmt::print(stderr,
               "phyxel: {}rank {} of {} has made no progress for {:.0f} s, since step {}; the "
               "other ranks wait for it\n",
               warning_word(), numbers[k], all, still, step);
  }

  double limit;
  int all;
  MPI_Comm host = MPI_COMM_NULL;
  MPI_Win window = MPI_WIN_NULL;
  Heartbeat* own = nullptr;
  std::vector<Heartbeat*> beats;  // heartbeats of the ranks of this host
  std::vector<int> numbers;       // numbers of those ranks
  std::mutex mutex;
  std::condition_variable changed;
  bool leave = false;
  std::thread thread;
};

Watchdog::Watchdog(const MpiCommunicator& ranks, double limit) {
  if (ranks.size() > 1 && limit > 0) heartbeats_ = std::make_unique<SharedHeartbeats>(ranks, limit);
}
Watchdog::~Watchdog() = default;
void Watchdog::close() {
  if (heartbeats_) heartbeats_->close();
  heartbeats_.reset();
}

void Watchdog::beat(std::int64_t step) const {
  if (!heartbeats_) return;
  heartbeats_->own->since = Heartbeat::now();
  heartbeats_->own->step = step;
}

}  // namespace phyxel
