/// A watchdog that reports a rank for which the others wait.
#pragma once

#include <cstdint>
#include <memory>

#include "mpi/communicator.hpp"

namespace phyxel {

/// A thread of each rank that monitors the ranks of its host, whose heartbeats in shared memory say
/// which step they have reached and whether they wait for other ranks. A rank that neither steps
/// nor waits for too long is reported on stderr, once for each step, by the first rank whose own
/// thread still runs.
class Watchdog {
 public:
  /// Starts the watch. Collective. @param limit time until a rank is reported [s]; 0: no watch
  Watchdog(const MpiCommunicator& ranks, double limit);
  /// Local: ends the watch of this rank. Without `close`, the shared memory lives until MPI ends.
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  /// Ends the watch and releases the shared memory. Collective.
  void close();

  /// Reports that this rank has reached a step.
  void beat(std::int64_t step) const;

 private:
  struct SharedHeartbeats;
  std::unique_ptr<SharedHeartbeats> heartbeats_;
};

}  // namespace phyxel
