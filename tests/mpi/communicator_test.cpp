/// Collective calls on the ranks of mpirun.
#include "mpi/communicator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>
#include <sched.h>

#include <span>
#include <vector>

#include "phyxel/types.hpp"
#include "ranks.hpp"

namespace phyxel {
namespace {

using test::world;
using ::testing::HasSubstr;

TEST(Communicator, KnowsItsRanks) {
  EXPECT_GE(world().rank(), 0);
  EXPECT_LT(world().rank(), world().size());
  const int rank = world().rank();
  const std::vector<int> all = world().gathered(std::span<const int>(&rank, 1));
  ASSERT_EQ(static_cast<int>(all.size()), world().size());
  for (int r = 0; r < world().size(); ++r) EXPECT_EQ(all[r], r);
  EXPECT_EQ(world().host_size(), world().size());  // all on this machine
  EXPECT_EQ(world().host_rank(), rank);
}

TEST(Communicator, ReducesOverAllRanks) {
  const int ranks = world().size(), rank = world().rank();
  EXPECT_EQ(world().sum(std::int64_t{rank + 1}), ranks * (ranks + 1) / 2);
  EXPECT_EQ(world().largest(std::int64_t{rank}), ranks - 1);
  EXPECT_EQ(world().smallest(std::int64_t{rank}), 0);
  EXPECT_EQ(world().largest(-1.5 * rank), 0);
  EXPECT_EQ(world().smallest(-1.5 * rank), -1.5 * (ranks - 1));
  // In the order of ranks, to the last bit.
  double expected = 0;
  for (int r = 0; r < ranks; ++r) expected += 1.0 / (r + 3);
  EXPECT_EQ(world().sum(1.0 / (rank + 3)), expected);
}

TEST(Communicator, GathersListsOfAnyLength) {
  const int rank = world().rank();
  std::vector<Vec3d> mine;  // none from the first rank
  for (int k = 0; k < 3 * rank; ++k) mine.push_back({1.0 * rank, 1.0 * k, 0.5});
  const std::vector<Vec3d> all = world().gathered(std::span<const Vec3d>(mine));
  std::vector<Vec3d> expected;
  for (int r = 0; r < world().size(); ++r) {
    for (int k = 0; k < 3 * r; ++k) expected.push_back({1.0 * r, 1.0 * k, 0.5});
  }
  EXPECT_TRUE(all == expected);
}

TEST(Communicator, ExchangesWithEveryRank) {
  const int ranks = world().size(), rank = world().rank();
  std::vector<std::vector<int>> send(static_cast<std::size_t>(ranks));
  for (int to = 0; to < ranks; ++to)
    send[to].assign(static_cast<std::size_t>(to + rank), 100 * rank + to);
  const auto received = world().alltoallv(send);
  ASSERT_EQ(static_cast<int>(received.size()), ranks);
  for (int from = 0; from < ranks; ++from) {
    EXPECT_EQ(received[from],
              std::vector<int>(static_cast<std::size_t>(rank + from), 100 * from + rank));
  }
}

TEST(Communicator, BroadcastsFromAnyRank) {
  const int last = world().size() - 1;
  std::vector<double> values;
  if (world().rank() == last) values = {1, 2.5, -3};
  EXPECT_EQ(world().broadcast(values, last), (std::vector<double>{1, 2.5, -3}));
}

/// Several ranks agree on an error; a single rank throws its own exception.
bool is_agreed(const Error& error) { return dynamic_cast<const AgreedError*>(&error) != nullptr; }

TEST(Communicator, AFailureOfOneIsThatOfAll) {
  const int last = world().size() - 1;
  try {
    world().collectively([&] {
      if (world().rank() == last) throw DeviceError("no GPU is left");
    });
    FAIL() << "nobody was told";
  } catch (const Error& error) {
    EXPECT_EQ(is_agreed(error), world().size() > 1);
    EXPECT_EQ(error.code(), ExitCode::device_failed);
    EXPECT_THAT(error.what(), HasSubstr("no GPU is left"));
    const std::string who = last > 0 ? "rank " + std::to_string(last) + " of" : "no GPU";
    EXPECT_THAT(error.what(), HasSubstr(who));
  }
  // What all say is said once, of nobody.
  try {
    world().collectively([] { throw InputError("scene.toml:3: unknown key"); });
    FAIL() << "nobody was told";
  } catch (const Error& error) {
    EXPECT_EQ(is_agreed(error), world().size() > 1);
    EXPECT_EQ(error.code(), ExitCode::bad_input);
    EXPECT_STREQ(error.what(), "scene.toml:3: unknown key");
  }
  int done = 0;
  world().collectively([&] { ++done; });
  EXPECT_EQ(done, 1);
}

/// The cores on which this thread may run.
cpu_set_t own_cores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  sched_getaffinity(0, sizeof cores, &cores);
  return cores;
}

/// Leaves this thread one core only, as mpirun does with --bind-to core.
void bind_to_one(const cpu_set_t& allowed, int which) {
  std::vector<int> cores;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(core, &allowed)) cores.push_back(core);
  }
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(cores[static_cast<std::size_t>(which) % cores.size()], &one);
  sched_setaffinity(0, sizeof one, &one);
}

TEST(Communicator, RanksThatWorkHaveTheCoresOfThoseThatWait) {
  const int before = omp_get_max_threads(), last = world().size() - 1;
  const cpu_set_t allowed = own_cores();
  bind_to_one(allowed, world().rank());
  const cpu_set_t bound = own_cores();
  omp_set_num_threads(1);
  cpu_set_t of_all;
  CPU_ZERO(&of_all);
  for (const cpu_set_t& one : world().gathered(std::span(&bound, 1)))
    CPU_OR(&of_all, &of_all, &one);
  const int cores = CPU_COUNT(&of_all);
  int works = 0, threads = 0, reached = 0;
  world().divided(world().rank() == last, [&] {
    works = 1;
    threads = omp_get_max_threads();
#pragma omp parallel reduction(max : reached)
    {
      const cpu_set_t here = own_cores();
      reached = CPU_COUNT(&here);
    }
  });
  EXPECT_EQ(works, world().rank() == last);
  if (works) {
    EXPECT_EQ(threads, cores);
    EXPECT_EQ(reached, cores);
  }
  EXPECT_EQ(omp_get_max_threads(), 1);
  const cpu_set_t after = own_cores();
  EXPECT_TRUE(CPU_EQUAL(&after, &bound));
  // Where all work, each has its own.
  world().divided(true, [&] { threads = omp_get_max_threads(); });
  EXPECT_EQ(threads, 1);
  sched_setaffinity(0, sizeof allowed, &allowed);
  omp_set_num_threads(before);
}

TEST(Communicator, AFailureOfDividedWorkNamesNoRank) {
  try {
    world().divided(world().rank() == world().size() - 1,
                    [] { throw InputError("scene.toml:3: no volume"); });
    FAIL() << "nobody was told";
  } catch (const Error& error) {
    EXPECT_EQ(is_agreed(error), world().size() > 1);
    EXPECT_STREQ(error.what(), "scene.toml:3: no volume");
  }
}

}  // namespace
}  // namespace phyxel
