#include "model/host_memory.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "phyxel/error.hpp"
#include "phyxel/types.hpp"

namespace phyxel {
namespace {

/// A limit in bytes from a file of one number; infinite if there is none.
double limit_in(const char* file) {
  double bytes = 0;
  return std::ifstream(file) >> bytes ? bytes : HUGE_VAL;
}

/// A line of this process's status, in bytes.
double status_bytes(const std::string& key) {
  std::ifstream lines("/proc/self/status");
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(key + ":", 0) == 0) return 1024 * std::atof(line.c_str() + key.size() + 1);
  }
  return 0;
}

int programs_of_host = 1;

}  // namespace

void share_host_memory(int programs) { programs_of_host = programs; }

double usable_memory() {
  const double machine =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
  const double host = std::min({machine, limit_in("/sys/fs/cgroup/memory.max"),
                                limit_in("/sys/fs/cgroup/memory/memory.limit_in_bytes")});
  return host / programs_of_host;
}

MemoryGrowth::MemoryGrowth() {
  malloc_trim(0);  // memory that is free but not yet given back would be used first, unseen
  before_ = status_bytes("VmRSS");
  std::ofstream("/proc/self/clear_refs") << 5;  // the peak begins anew
}

double MemoryGrowth::largest() const { return status_bytes("VmHWM") - before_; }

double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

void require_host_memory(const std::string& what, double phyxels, double bytes_per_phyxel) {
  const double most_index = std::numeric_limits<Index>::max();
  const double memory = usable_memory();
  if (phyxels <= most_index && phyxels * bytes_per_phyxel <= memory) return;
  throw InputError(fmt::format(
      "{}: {:.0f} phyxels need about {:.3g} GiB of memory, but {:.3g} GiB are available{}: at most "
      "{:.0f} phyxels are allowed",
      what, phyxels, phyxels * bytes_per_phyxel / 0x1p30, memory / 0x1p30,
      programs_of_host > 1 ? fmt::format(" to each of {} ranks", programs_of_host) : "",
      std::floor(std::min(most_index, memory / bytes_per_phyxel))));
}

}  // namespace phyxel
