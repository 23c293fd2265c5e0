/// The communicator of a run over MPI: one rank, unless mpirun or srun has started several. This
/// header does not include MPI's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "bulk.hpp"
#include "phyxel/communicator.hpp"
#include "phyxel/error.hpp"
#include "phyxel/ranks.hpp"

namespace phyxel {

/// The message for a std::bad_alloc that ends a program.
inline constexpr const char* out_of_memory =
    "out of memory: fewer phyxels, or a machine with more memory, are needed";

/// Values for each rank, or from each rank, concatenated in the order of ranks.
template <class T>
struct ByRank {
  Bulk<T> values;
  std::vector<std::size_t> begin{0};  ///< First value of each rank, and the end, shape [ranks + 1].

  std::span<const T> of(int rank) const {
    const auto r = static_cast<std::size_t>(rank);
    return {values.data() + begin[r], begin[r + 1] - begin[r]};
  }
};

/// Tags of messages between two ranks, in a duplicate of the caller's communicator.
enum class Tag : int { alltoallv = 1, halo = 2 };

/// A duplicate of an MPI communicator, so that the caller's messages, tags and error handlers are
/// not touched. Functions are collective (all ranks call them in the same order), except `rank`,
/// `size`, `host_of` and `abort`. Only the thread that constructed the object may call them.
class MpiCommunicator final : public Communicator {
 public:
  /// Constructs a communicator of one rank, without MPI.
  MpiCommunicator() = default;
  /// Duplicates MPI_COMM_WORLD. Starts MPI if it does not run yet.
  /// @throws Error if MPI does not start, if its thread level is too low, or if there are several
  ///   ranks in a build without MPI
  MpiCommunicator(int& argc, char**& argv);
  /// Duplicates a caller's communicator. Collective over it; MPI must run.
  /// @throws Error naming both levels if MPI's thread level is too low
  explicit MpiCommunicator(CommunicatorHandle callers);
  /// Local. Without `close`, the duplicate lives until MPI ends.
  ~MpiCommunicator() override;
  MpiCommunicator(const MpiCommunicator&) = delete;
  MpiCommunicator& operator=(const MpiCommunicator&) = delete;

  /// Releases the duplicate, and ends MPI if the constructor has started it. Waits for messages
  /// whose `Transfers` have been destroyed. No other function may be called afterwards.
  void close();

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  /// Number of ranks on this host, by which a GPU is chosen.
  int host_size() const { return host_size_; }
  int host_rank() const { return host_rank_; }  ///< Index of this rank among them.
  /// A number of the rank's host, which ranks of one host share.
  int host_of(int rank) const { return hosts_[rank]; }

  void barrier() const;
  /// A barrier at which ranks sleep, and leave their cores to the ranks that still work.
  void wait_asleep() const;

  /// Sum over the ranks, in their order, so that each run gets the same bits.
  double sum(double value) const;
  std::int64_t sum(std::int64_t value) const;
  double largest(double value) const override;
  std::int64_t largest(std::int64_t value) const;
  double smallest(double value) const override;
  std::int64_t smallest(std::int64_t value) const;

  /// Element-wise sum over the ranks, in place.
  void add(std::span<std::int64_t> values) const override;

  /// The values of all ranks, concatenated, on each rank.
  template <class T>
  std::vector<T> gathered(std::span<const T> values) const {
    return from_bytes<T>(gathered_bytes(std::as_bytes(values)));
  }
  /// The values of rank `from`, on each rank.
  template <class T>
  std::vector<T> broadcast(std::vector<T> values, int from = 0) const {
    static_assert(std::is_trivially_copyable_v<T>);
    std::int64_t count = static_cast<std::int64_t>(values.size());
    broadcast_bytes(std::as_writable_bytes(std::span(&count, 1)), from);
    values.resize(static_cast<std::size_t>(count));
    broadcast_bytes(std::as_writable_bytes(std::span(values)), from);
    return values;
  }
  std::vector<std::vector<std::byte>> alltoallv(
      const std::vector<std::vector<std::byte>>& words) const override {
    return alltoallv<std::byte>(words);
  }
  /// All-to-all exchange: sends `send[r]` to rank r and returns the values received from each rank.
  template <class T>
  std::vector<std::vector<T>> alltoallv(const std::vector<std::vector<T>>& send) const {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::size_t ranks = send.size();
    std::vector<std::int64_t> sizes(ranks);
    for (std::size_t r = 0; r < ranks; ++r) sizes[r] = static_cast<std::int64_t>(send[r].size());
    sizes = alltoall(sizes);
    std::vector<std::vector<T>> received(ranks);
    std::vector<std::span<const std::byte>> out;
    std::vector<std::span<std::byte>> in;
    for (std::size_t r = 0; r < ranks; ++r) {
      received[r].resize(static_cast<std::size_t>(sizes[r]));
      out.push_back(std::as_bytes(std::span(send[r])));
      in.push_back(std::as_writable_bytes(std::span(received[r])));
    }
    exchange(out, in);
    return received;
  }
  /// All-to-all exchange of large arrays, each with the offsets of the ranks.
  template <class T>
  ByRank<T> alltoallv(const ByRank<T>& send) const {
    static_assert(std::is_trivially_copyable_v<T>);
    std::vector<std::int64_t> sizes;
    for (int r = 0; r < size_; ++r) sizes.push_back(static_cast<std::int64_t>(send.of(r).size()));
    ByRank<T> received;
    for (const std::int64_t size : alltoall(sizes)) {
      received.begin.push_back(received.begin.back() + static_cast<std::size_t>(size));
    }
    received.values.resize(received.begin.back());
    std::vector<std::span<const std::byte>> out;
    std::vector<std::span<std::byte>> in;
    for (int r = 0; r < size_; ++r) {
      const std::span<const T> from = received.of(r);
      out.push_back(std::as_bytes(send.of(r)));
      in.push_back(std::as_writable_bytes(
          std::span(received.values).subspan(from.data() - received.values.data(), from.size())));
    }
    exchange(out, in);
    return received;
  }

  /// Runs `work`, which must not communicate, on each rank, and then agrees on the outcome.
  /// @throws AgreedError on each rank if `work` threw on any, with the message and the exit code of
  ///   the first rank that failed; with one rank, what `work` threw
  void collectively(const std::function<void()>& work) const { run(work, false); }
  /// Runs `work` likewise on the ranks where `works` is true; they have the cores of the ranks of
  /// their host that wait. It does not matter to a user which rank failed: messages name none.
  void divided(bool works, const std::function<void()>& work) const;

  /// Returns `make()`, which must not communicate. @throws AgreedError as `collectively`
  template <class Make>
  auto agreed(Make&& make) const {
    std::optional<decltype(make())> made;
    collectively([&] { made.emplace(make()); });
    return std::move(*made);
  }

  /// Ends all ranks at once, for an error that other ranks cannot detect.
  [[noreturn]] void abort(ExitCode code) const;

  /// The duplicate, for files that include mpi/native.hpp; null without MPI.
  struct Native;
  const std::shared_ptr<Native>& native() const { return native_; }

 private:
  void describe_hosts();
  template <class T>
  static std::vector<T> from_bytes(const std::vector<std::byte>& bytes) {
    static_assert(std::is_trivially_copyable_v<T>);
    std::vector<T> values(bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }
  /// Runs `work` and agrees on the outcome. @param divided true if messages name no rank, and ranks
  /// wait asleep
  void run(const std::function<void()>& work, bool divided) const;
  std::vector<std::byte> gathered_bytes(std::span<const std::byte> bytes) const;
  void broadcast_bytes(std::span<std::byte> bytes, int from) const;
  /// Sends numbers[r] to rank r, and returns the number received from each rank.
  std::vector<std::int64_t> alltoall(const std::vector<std::int64_t>& numbers) const;
  /// Exchanges messages whose lengths both sides know.
  void exchange(const std::vector<std::span<const std::byte>>& send,
                const std::vector<std::span<std::byte>>& receive) const;

  int rank_ = 0, size_ = 1, host_rank_ = 0, host_size_ = 1;
  std::vector<int> hosts_{0};  // host number of each rank
  std::shared_ptr<Native> native_;
};

/// True if mpirun, srun or another launcher has started this program as one of several ranks.
bool launched_as_rank();

/// True if the MPI library reports that messages may be in a GPU's memory.
bool mpi_takes_device_memory();

/// Description of the MPI library, e.g. "Open MPI v4.1.4, not CUDA-aware".
std::string mpi_description();

/// Non-blocking messages between this rank and others, whose lengths both sides know. Not
/// collective.
class Transfers {
 public:
  Transfers(const MpiCommunicator& ranks, Tag tag);
  /// Local. Active requests, and the memory given to `keep`, are handed to the communicator, which
  /// completes them.
  ~Transfers();
  Transfers(const Transfers&) = delete;
  Transfers& operator=(const Transfers&) = delete;

  /// Starts to receive a message. `bytes` must not be accessed until `wait` has returned.
  void receive(int from, std::span<std::byte> bytes);
  /// Starts to send a message. `bytes` must not be changed until `wait` has returned.
  void send(int to, std::span<const std::byte> bytes);
  /// Keeps the owner of the messages' memory alive until the messages are complete.
  void keep(std::shared_ptr<void> memory);
  /// Lets MPI make progress: many MPI libraries transfer large messages only during calls.
  void progress();
  /// Waits until all messages have been sent and received.
  void wait();

 private:
  struct Requests;
  std::shared_ptr<MpiCommunicator::Native> native_;
  Tag tag_;
  std::unique_ptr<Requests> requests_;
};

}  // namespace phyxel
