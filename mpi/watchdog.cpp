#include "mpi/watchdog.hpp"

#include <fmt/format.h>
#include <mpi.h>

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <new>
#include <thread>
#include <vector>

#include "mpi/pulse.hpp"
#include "terminal.hpp"

namespace phyxel {

std::atomic<Pulse*> own_pulse{nullptr};

struct Watchdog::Kennel {
  Kennel(const Communicator& ranks, double seconds) : limit(seconds), all(ranks.size()) {
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, ranks.rank(), MPI_INFO_NULL, &host);
    void* memory = nullptr;
    MPI_Win_allocate_shared(sizeof(Pulse), 1, MPI_INFO_NULL, host, &memory, &window);
    own = new (memory) Pulse;
    own->since = own->watching = Pulse::now();
    MPI_Barrier(host);
    for (int r = 0; r < ranks.size(); ++r) {
      if (ranks.host_of(r) != ranks.host_of(ranks.rank())) continue;
      MPI_Aint bytes = 0;
      int unit = 0;
      MPI_Win_shared_query(window, static_cast<int>(pulses.size()), &bytes, &unit, &memory);
      pulses.push_back(static_cast<Pulse*>(memory));
      numbers.push_back(r);
    }
    own_pulse = own;
    thread = std::thread([this] { watch(); });
  }
  ~Kennel() {
    own_pulse = nullptr;
    own->ended = 1;
    {
      const std::lock_guard lock(mutex);
      leave = true;
    }
    changed.notify_all();
    thread.join();
    // Both are collective; an error may be of this rank alone, which then ends them all.
    if (std::uncaught_exceptions() > 0) return;
    MPI_Win_free(&window);
    MPI_Comm_free(&host);
  }

  void watch() {
    const auto pause = std::chrono::duration<double>(std::clamp(limit / 4, 0.05, 1.0));
    std::unique_lock lock(mutex);
    while (!changed.wait_for(lock, pause, [&] { return leave; })) {
      const std::int64_t now = Pulse::now();
      const std::int64_t last_look = own->watching.exchange(now);
      if (1e-9 * static_cast<double>(now - last_look) > limit) continue;  // it was this one
      // One speaks: the first whose thread has looked lately.
      const auto awake = [&](const Pulse* p) {
        return p == own || (!p->ended && 1e-9 * static_cast<double>(now - p->watching) < limit);
      };
      if (*std::find_if(pulses.begin(), pulses.end(), awake) != own) continue;
      for (std::size_t k = 0; k < pulses.size(); ++k) look_at(k, now);
    }
  }
  void look_at(std::size_t k, std::int64_t now) {
    Pulse& pulse = *pulses[k];
    // Even one that waits looks about; unless its process has been stopped, or its host is too
    // busy.
    const std::int64_t last = pulse.waiting ? pulse.watching : pulse.since;
    const double still = 1e-9 * static_cast<double>(now - last);
    const std::int64_t step = pulse.step;
    if (pulse.ended || still < limit || pulse.named_at.exchange(step) == step) return;
    fmt::print(stderr,
               "phyxel: {}rank {} of {} has not come on for {:.0f} s, since step {}; the "
               "others wait for it\n",
               warning_word(), numbers[k], all, still, step);
  }

  double limit;
  int all;
  MPI_Comm host = MPI_COMM_NULL;
  MPI_Win window = MPI_WIN_NULL;
  Pulse* own = nullptr;
  std::vector<Pulse*> pulses;  // of the ranks of this host
  std::vector<int> numbers;    // of those ranks
  std::mutex mutex;
  std::condition_variable changed;
  bool leave = false;
  std::thread thread;
};

Watchdog::Watchdog(const Communicator& ranks, double limit) {
  if (ranks.size() > 1 && limit > 0) kennel_ = std::make_unique<Kennel>(ranks, limit);
}
Watchdog::~Watchdog() = default;

void Watchdog::beat(std::int64_t step) const {
  if (!kennel_) return;
  kennel_->own->since = Pulse::now();
  kennel_->own->step = step;
}

}  // namespace phyxel
