/// Ranks in a program that uses MPI itself: its communicators, messages and error handlers are not
/// affected.
#include <gmock/gmock.h>
#include <mpi.h>

#include <array>
#include <optional>

#include "mpi/communicator.hpp"
#include "phyxel/phyxel.hpp"
#include "phyxel/shared_model.hpp"
#include "ranks.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using test::world;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// A communicator of the ranks with an even or an odd number.
class Embedding : public ::testing::Test {
 protected:
  void SetUp() override {
    int running = 0;
    MPI_Initialized(&running);
    if (!running) GTEST_SKIP() << "one rank, without MPI";
    MPI_Comm_split(MPI_COMM_WORLD, world().rank() % 2, world().rank(), &half_);
  }
  void TearDown() override {
    if (half_ != MPI_COMM_NULL) MPI_Comm_free(&half_);
  }
  int half_size() const { return (world().size() + 1 - world().rank() % 2) / 2; }
  CommunicatorHandle handle() const { return {MPI_Comm_c2f(half_)}; }

  MPI_Comm half_ = MPI_COMM_NULL;
};

/// Exchanges a number between all ranks in each round, by both kinds of messages.
void expect_right_exchanges(const MpiCommunicator& ranks) {
  for (int round = 0; round < 20; ++round) {
    const auto number = [&](int from, int to) { return 10'000 * round + 100 * from + to; };
    std::vector<std::vector<int>> send;
    for (int to = 0; to < ranks.size(); ++to) send.push_back({number(ranks.rank(), to)});
    const auto received = ranks.alltoallv(send);
    auto arrived = std::vector(send.size(), -1);
    Transfers transfers(ranks, Tag::halo);
    for (int r = 0; r < ranks.size(); ++r) {
      EXPECT_EQ(received[r], std::vector{number(r, ranks.rank())});
      if (r == ranks.rank()) continue;
      transfers.receive(r, std::as_writable_bytes(std::span(&arrived[r], 1)));
      transfers.send(r, std::as_bytes(std::span(send[r])));
    }
    transfers.progress();
    transfers.wait();
    for (int r = 0; r < ranks.size(); ++r) {
      if (r != ranks.rank()) {
        EXPECT_EQ(arrived[r], number(r, ranks.rank()));
      }
    }
  }
}

/// The caller posts a receive that matches any message, and sends messages with the same tags.
TEST_F(Embedding, MessagesOfTheCallerArriveAtTheCaller) {
  const int size = world().size(), next = (world().rank() + 1) % size;
  constexpr std::array tags{static_cast<int>(Tag::alltoallv), static_cast<int>(Tag::halo)};
  std::array<int, 2> sent{-7, -8}, heard{};
  std::array<MPI_Request, 4> requests{};
  for (std::size_t k = 0; k < tags.size(); ++k) {
    MPI_Irecv(&heard[k], 1, MPI_INT, MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &requests[k]);
  }
  expect_right_exchanges(world());
  EXPECT_EQ(heard, (std::array<int, 2>{}));
  MPI_Barrier(MPI_COMM_WORLD);  // before another rank's may come
  for (std::size_t k = 0; k < tags.size(); ++k) {
    MPI_Isend(&sent[k], 1, MPI_INT, next, tags[k], MPI_COMM_WORLD, &requests[2 + k]);
  }
  expect_right_exchanges(world());
  MPI_Waitall(4, requests.data(), MPI_STATUSES_IGNORE);
  EXPECT_EQ(heard, sent);
}

TEST_F(Embedding, ACommunicatorOfTheCallersHasItsOwnRanks) {
  Ranks half(handle());
  EXPECT_EQ(half.size(), half_size());
  EXPECT_EQ(half.rank(), world().rank() / 2);
  EXPECT_EQ(half.host_size(), half_size());
  EXPECT_EQ(half.sum(1), half_size());
  expect_right_exchanges(half.communicator());
  half.close();
  int sum = 0;  // the caller's communicator is there still
  const int one = 1;
  MPI_Allreduce(&one, &sum, 1, MPI_INT, MPI_SUM, half_);
  EXPECT_EQ(sum, half_size());
}

/// Each half of the ranks steps a different body.
TEST_F(Embedding, HalvesOfTheRanksStepBodiesOfTheirOwn) {
  Scene scene = testing::one_body();
  scene.bodies[0].source.shape = {.name = "beam", .size = {1, 0.5, 0.5}, .spacing = 0.1};
  scene.bodies[0].spin = {0, world().rank() % 2 == 0 ? 3.0 : -2.0, 0};
  const auto speed_of = [&](const Ranks& ranks) {
    const SharedModel shared(ranks, scene, choose_device("cpu"));
    const auto backend = shared.make_backend(Precision::double_, 1);
    const double dt = 0.5 * step_limit(shared.here(), *backend).largest_step;
    Solver solver(*backend, initial_state(shared.here(), scene, dt));
    solver.step(30);
    return diagnose(shared.here(), *backend, solver.steps(), dt).largest_speed;
  };
  Ranks half(handle());
  const double speed = speed_of(half);
  EXPECT_EQ(speed, speed_of(Ranks()));
  EXPECT_GT(speed, 0);
  half.close();
}

MPI_Errhandler handler_of(MPI_Comm communicator) {
  MPI_Errhandler handler{};
  MPI_Comm_get_errhandler(communicator, &handler);
  return handler;
}

TEST_F(Embedding, ErrorsOfTheCallersCommunicatorAreHandledAsBefore) {
  EXPECT_EQ(handler_of(MPI_COMM_WORLD), MPI_ERRORS_ARE_FATAL);
  const MPI_Errhandler before = handler_of(half_);
  Ranks half(handle());
  EXPECT_EQ(handler_of(half_), before);
  if (half.size() > 1) {
    try {
      half.communicator().broadcast(std::vector{1}, half.size());
      ADD_FAILURE() << "a rank that is not there has sent something";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("MPI_Bcast"), HasSubstr("invalid root")));
    }
  }
  half.close();
}

/// Ranks end at different times: no destructor waits.
TEST_F(Embedding, DestructorsAreLocal) {
  auto half = std::make_optional<Ranks>(handle());
  if (half->rank() == 0) half.reset();
  MPI_Barrier(half_);
  half.reset();
}

/// Messages of destroyed `Transfers` complete in memory that is kept for them, and are not confused
/// with later messages.
TEST_F(Embedding, MessagesOutliveTheirTransfers) {
  Ranks half(handle());
  const MpiCommunicator& ranks = half.communicator();
  const auto start = [&](Transfers& transfers, int value) {
    constexpr std::size_t length = 1 << 18;  // beyond what MPI sends unasked
    struct Memory {
      std::vector<int> out, in;
    };
    const auto memory = std::make_shared<Memory>();
    memory->out.assign(length, value);
    memory->in.assign(length, -1);
    const int next = (ranks.rank() + 1) % ranks.size();
    const int last = (ranks.rank() + ranks.size() - 1) % ranks.size();
    transfers.keep(memory);
    transfers.receive(last, std::as_writable_bytes(std::span(memory->in)));
    transfers.send(next, std::as_bytes(std::span(memory->out)));
    return memory;
  };
  std::weak_ptr<void> first;
  {
    Transfers dropped(ranks, Tag::halo);
    first = start(dropped, 1);
  }
  EXPECT_FALSE(first.expired());
  Transfers transfers(ranks, Tag::halo);
  const auto second = start(transfers, 2);
  transfers.wait();
  EXPECT_EQ(second->in, second->out);
  half.close();
  EXPECT_TRUE(first.expired());
}

}  // namespace
}  // namespace phyxel
