#include "thread_policy.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>

namespace phyxel::app {
namespace {

// Turns of libgomp's loop before a waiting thread sleeps: tens of microseconds, a fraction of a
// step that is worth several threads. By default it spins 300,000 turns, milliseconds in which a
// thread of another program, or the one that is waited for, could have had the core.
constexpr const char* turns = "1000";

bool starts_with(std::string_view text, std::string_view head) {
  return text.substr(0, head.size()) == head;
}

}  // namespace

void settle_thread_policy(char** argv) {
  if (std::getenv("OMP_WAIT_POLICY") != nullptr || std::getenv("GOMP_SPINCOUNT") != nullptr) return;
  std::error_code failed;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", failed);
  // Started through the dynamic loader, "self" is the loader, whose arguments are others.
  if (failed || starts_with(self.filename().string(), "ld")) return;
  // The variable is also what keeps the program from starting itself a second time.
  if (setenv("GOMP_SPINCOUNT", turns, 1) != 0) return;
  execv("/proc/self/exe", argv);
  unsetenv("GOMP_SPINCOUNT");  // not started: the runtime has not seen it
}

std::string thread_policy() {
  // The environment that the process began with; what is set later comes too late for the runtime.
  std::ifstream file("/proc/self/environ", std::ios::binary);
  const std::string all((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  std::string found;
  for (std::size_t at = 0; at < all.size();) {
    const std::string_view entry(all.c_str() + at);
    // libgomp lets the count overrule the policy.
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
