#include "mpi/host_threads.hpp"

#include <omp.h>
#include <sched.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace phyxel {
namespace {

/// The threads and cores of a rank, as ranks tell each other.
struct RankThreads {
  std::int64_t works, threads;
  cpu_set_t cores;  ///< On which the rank may run.
};

cpu_set_t own_cores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  // It fails on hosts with more cores than a set has places, and then leaves it empty.
  sched_getaffinity(0, sizeof cores, &cores);
  return cores;
}

}  // namespace

HostThreads::HostThreads(const MpiCommunicator& ranks, bool works) : own_(omp_get_max_threads()) {
  if (ranks.size() == 1) return;
  const RankThreads here{works, own_, own_cores()};
  const std::vector<RankThreads> all = ranks.gathered(std::span(&here, 1));
  std::int64_t threads = 0, workers = 0;
  cpu_set_t cores;
  CPU_ZERO(&cores);
  for (int r = 0; r < ranks.size(); ++r) {
    if (ranks.host_of(r) != ranks.host_of(ranks.rank())) continue;
    const RankThreads& of_rank = all[static_cast<std::size_t>(r)];
    threads += of_rank.threads;
    workers += of_rank.works;
    CPU_OR(&cores, &cores, &of_rank.cores);
  }
  if (!works) return;
  const int most = std::max(CPU_COUNT(&cores), own_);
  const int more = std::min(static_cast<int>(threads / workers), most);
  if (more <= own_) return;
  omp_set_num_threads(more);
  before_.resize(static_cast<std::size_t>(more), here.cores);
#pragma omp parallel num_threads(more)
  {
    cpu_set_t& before = before_[static_cast<std::size_t>(omp_get_thread_num())];
    sched_getaffinity(0, sizeof before, &before);
    sched_setaffinity(0, sizeof cores, &cores);
  }
}

HostThreads::~HostThreads() {
  if (before_.empty()) return;
#pragma omp parallel num_threads(static_cast <int>(before_.size()))
  {
    const cpu_set_t& before = before_[static_cast<std::size_t>(omp_get_thread_num())];
    sched_setaffinity(0, sizeof before, &before);
  }
  omp_set_num_threads(own_);
}

}  // namespace phyxel
