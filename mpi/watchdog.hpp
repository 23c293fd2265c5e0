/// Names the rank that the others wait for.
#pragma once

#include <cstdint>
#include <memory>

#include "mpi/communicator.hpp"

namespace phyxel {

/// A thread of each rank that looks at the ranks of its host, which tell in shared memory how far
/// they have come and whether they wait for others: one that does neither for long is named on
/// stderr, once for each step that it is stuck in, by the first rank whose own thread still runs.
class Watchdog {
 public:
  /// Collective. @param limit how long is long [s]; 0: nobody looks
  Watchdog(const MpiCommunicator& ranks, double limit);
  /// Local: this rank is no longer watched. MPI keeps the shared memory until it ends, unless
  /// `close` has released it.
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  /// Ends the watch and releases the memory that ranks share. Collective.
  void close();

  /// This rank is alive, and has come to this step.
  void beat(std::int64_t step) const;

 private:
  struct SharedHeartbeats;
  std::unique_ptr<SharedHeartbeats> heartbeats_;
};

}  // namespace phyxel
