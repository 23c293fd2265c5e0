#include "thread_policy.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>

namespace phyxel::app {
namespace {

// Iterations of libgomp's loop before a waiting thread sleeps: tens of microseconds, a fraction of
// a step that is worth several threads. By default it spins for 300,000 iterations, milliseconds in
// which a thread of another program, or the awaited one, could have had the core.
constexpr const char* turns = "1000";

bool starts_with(std::string_view text, std::string_view head) {
  return text.substr(0, head.size()) == head;
}

}  // namespace

void settle_thread_policy(char** argv) {
  if (std::getenv("OMP_WAIT_POLICY") != nullptr || std::getenv("GOMP_SPINCOUNT") != nullptr) return;
  std::error_code failed;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", failed);
  // A program started through the dynamic loader cannot be restarted: "self" is the loader.
  if (failed || starts_with(self.filename().string(), "ld")) return;
  // The variable also prevents a second restart.
  if (setenv("GOMP_SPINCOUNT", turns, 1) != 0) return;
  execv("/proc/self/exe", argv);
  unsetenv("GOMP_SPINCOUNT");  // the restart failed, and the runtime has not read the variable
}

std::string thread_policy() {
  // The initial environment: the runtime does not see variables that are set later.
  std::ifstream file("/proc/self/environ", std::ios::binary);
  const std::string all((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  std::string found;
  for (std::size_t at = 0; at < all.size();) {
    const std::string_view entry(all.c_str() + at);
    // In libgomp the count overrides the policy.
    if (starts_with(entry, "GOMP_SPINCOUNT=") ||
        (found.empty() && starts_with(entry, "OMP_WAIT_POLICY="))) {
      found = entry;
    }
    at += entry.size() + 1;
  }
  return found;
}

std::optional<HostLoad> host_load() {
  HostLoad host;
  host.cores = sysconf(_SC_NPROCESSORS_ONLN);
  if (host.cores < 1 || getloadavg(&host.load, 1) != 1) return {};
  return host;
}

}  // namespace phyxel::app
