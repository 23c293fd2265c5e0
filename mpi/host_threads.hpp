/// The cores of ranks that wait.
#pragma once

#include <sched.h>

#include <vector>

#include "mpi/communicator.hpp"

namespace phyxel {

/// Scope in which ranks that work have the threads and cores of the other ranks of their host,
/// which wait.
class HostThreads {
 public:
  /// Collective. @param works true on the ranks that work
  HostThreads(const MpiCommunicator& ranks, bool works);
  /// Gives the cores back. Local.
  ~HostThreads();
  HostThreads(const HostThreads&) = delete;
  HostThreads& operator=(const HostThreads&) = delete;

 private:
  int own_;                        ///< Number of threads before.
  std::vector<cpu_set_t> before_;  ///< Cores of each thread before; empty if they are the same.
};

}  // namespace phyxel
