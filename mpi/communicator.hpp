/// The ranks of a run over MPI: one, unless mpirun or srun has started several. No MPI header is
/// needed to include this.
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

/// What is said where std::bad_alloc ends a program.
inline constexpr const char* out_of_memory =
    "out of memory: fewer phyxels, or a machine with more memory, are needed";

/// Values for each rank, or from each: one rank's after the other's.
template <class T>
struct ByRank {
  Bulk<T> values;
  std::vector<std::size_t> begin{0};  ///< Of each rank's, and where all end; shape [ranks + 1].

  std::span<const T> of(int rank) const {
    const auto r = static_cast<std::size_t>(rank);
    return {values.data() + begin[r], begin[r + 1] - begin[r]};
  }
};

/// Tags of messages between two ranks. Messages of a caller never meet them: they travel in a
/// duplicate of its communicator.
enum class Tag : int { alltoallv = 1, halo = 2 };

/// The ranks of a run, in a duplicate of an MPI communicator: messages, tags and errors of the
/// caller's own are not touched. Every function but `rank`, `size`, `host_of` and `abort` is
/// collective: all ranks call it, in the same order. The thread that constructs it calls it.
class MpiCommunicator final : public Communicator {
 public:
  /// One rank, without MPI.
  MpiCommunicator() = default;
  /// All ranks of the program, MPI_COMM_WORLD. Starts MPI unless it runs.
  /// @throws Error if MPI does not start or supports fewer threads than are needed, or if there are
  ///   several ranks in a build without it
  MpiCommunicator(int& argc, char**& argv);
  /// The ranks of a caller's communicator. Collective over it; MPI must run.
  /// @throws Error naming both levels if MPI was started for fewer threads than are needed
  explicit MpiCommunicator(CommunicatorHandle callers);
  /// Local. MPI keeps the duplicate until it ends, unless `close` has released it.
  ~MpiCommunicator() override;
  MpiCommunicator(const MpiCommunicator&) = delete;
  MpiCommunicator& operator=(const MpiCommunicator&) = delete;

  /// Releases the duplicate, and ends MPI if the constructor has started it. Waits for messages
  /// whose `Transfers` are gone. No other function may be called after it.
  void close();

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  /// Ranks of this host, and which of them this is: for the choice of a GPU.
  int host_size() const { return host_size_; }
  int host_rank() const { return host_rank_; }
  /// Ranks of one host have the same number, whatever it is.
  int host_of(int rank) const { return hosts_[rank]; }

  void barrier() const;

  /// Over all ranks, in the order of ranks, so that every run gets the same bits.
  double sum(double value) const;
  std::int64_t sum(std::int64_t value) const;
  double largest(double value) const override;
  std::int64_t largest(std::int64_t value) const;
  double smallest(double value) const override;
  std::int64_t smallest(std::int64_t value) const;

  /// Element by element, in place.
  void add(std::span<std::int64_t> values) const override;

  /// The values of all ranks, one after the other, on every rank.
  template <class T>
  std::vector<T> gathered(std::span<const T> values) const {
    return from_bytes<T>(gathered_bytes(std::as_bytes(values)));
  }
  /// `values` of rank `from`, on every rank.
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
  /// The same for large arrays, each one array with the offsets of the ranks.
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

  /// Does the work of this rank, which must not communicate; then all agree how it went.
  /// @throws AgreedError on every rank if it threw on any, with the message and the exit code of
  /// the
  ///   first rank that failed; what it threw, if there is one rank
  void collectively(const std::function<void()>& work) const;

  /// `make()`, which must not communicate, on every rank. @throws AgreedError as `collectively`
  template <class Make>
  auto agreed(Make&& make) const {
    std::optional<decltype(make())> made;
    collectively([&] { made.emplace(make()); });
    return std::move(*made);
  }

  /// Ends all ranks at once, for errors that no rank but this knows of.
  [[noreturn]] void abort(ExitCode code) const;

  /// The duplicate, for those who include mpi/native.hpp; null without MPI.
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
  std::vector<std::byte> gathered_bytes(std::span<const std::byte> bytes) const;
  void broadcast_bytes(std::span<std::byte> bytes, int from) const;
  /// Sends numbers[r] to rank r and returns the number received from each rank.
  std::vector<std::int64_t> alltoall(const std::vector<std::int64_t>& numbers) const;
  /// Both sides know the lengths.
  void exchange(const std::vector<std::span<const std::byte>>& send,
                const std::vector<std::span<std::byte>>& receive) const;

  int rank_ = 0, size_ = 1, host_rank_ = 0, host_size_ = 1;
  std::vector<int> hosts_{0};  // of each rank
  std::shared_ptr<Native> native_;
};

/// Whether mpirun, srun or another launcher has started this program as one of several.
bool launched_as_rank();

/// Whether messages may be in a GPU's memory, as the MPI library says that runs.
bool mpi_takes_device_memory();

/// e.g. "Open MPI v4.1.4, not CUDA-aware", or that there is none.
std::string mpi_description();

/// Messages under way between this rank and others, whose lengths both sides know. Not collective.
class Transfers {
 public:
  Transfers(const MpiCommunicator& ranks, Tag tag);
  /// Local. Messages that are still under way are left to the communicator, and with them the
  /// memory that `keep` has named: no active request is freed.
  ~Transfers();
  Transfers(const Transfers&) = delete;
  Transfers& operator=(const Transfers&) = delete;

  /// Starts to receive a message. The bytes must not be touched until `wait` has returned.
  void receive(int from, std::span<std::byte> bytes);
  /// Starts to send a message; likewise.
  void send(int to, std::span<const std::byte> bytes);
  /// The owner of the memory that messages are received into and sent from.
  void keep(std::shared_ptr<void> memory);
  /// Lets MPI work on the messages. Many an MPI moves large ones in its calls alone.
  void progress();
  /// Waits until all messages have arrived, here and there.
  void wait();

 private:
  struct Requests;
  std::shared_ptr<MpiCommunicator::Native> native_;
  Tag tag_;
  std::unique_ptr<Requests> requests_;
};

}  // namespace phyxel
