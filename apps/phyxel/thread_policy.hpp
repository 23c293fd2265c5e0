/// Wait policy of OpenMP's threads, and the load of the machine.
#pragma once

#include <optional>
#include <string>

namespace phyxel::app {

/// Makes waiting threads spin for a fraction of a step and then sleep, unless the user's
/// environment sets a policy (OMP_WAIT_POLICY or GOMP_SPINCOUNT). The OpenMP runtime reads the
/// environment when it is loaded, so the program restarts itself, once, in the same process.
/// Returns if nothing had to be done, or if the restart fails.
void settle_thread_policy(char** argv);

/// The variable that set the OpenMP runtime's policy, e.g. "GOMP_SPINCOUNT=1000"; "" if none did.
std::string thread_policy();

/// Number of runnable threads on this host, averaged over a minute (the load), and number of cores.
struct HostLoad {
  double load = 0;
  long cores = 1;
  /// True if the load exceeds the number of cores by more than the noise of the average.
  bool exceeds() const { return load > static_cast<double>(cores) + 0.5; }
};
/// The load of the host; unset if the system does not provide it.
std::optional<HostLoad> host_load();

}  // namespace phyxel::app
