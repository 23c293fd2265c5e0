/// How OpenMP's threads wait for each other, and whether the machine is shared with other programs.
#pragma once

#include <optional>
#include <string>

namespace phyxel::app {

/// Makes waiting threads spin for a fraction of a step only and then sleep, unless the user's
/// environment says how they wait (OMP_WAIT_POLICY or GOMP_SPINCOUNT). The OpenMP runtime reads the
/// environment when it is loaded, so the program starts itself again, once, in the same process.
/// Returns if nothing had to be done, or if the program cannot be started again.
void settle_thread_policy(char** argv);

/// The variable that the OpenMP runtime found when it was loaded, e.g. "GOMP_SPINCOUNT=1000"; ""
/// if it found none.
std::string thread_policy();

/// Threads ready to run on this host, averaged over a minute (the load), and the cores they share.
struct HostLoad {
  double load = 0;
  long cores = 1;
  /// True if more threads want to run than there are cores, beyond the noise of the average.
  bool exceeds() const { return load > static_cast<double>(cores) + 0.5; }
};
/// Empty where the system does not say.
std::optional<HostLoad> host_load();

}  // namespace phyxel::app
