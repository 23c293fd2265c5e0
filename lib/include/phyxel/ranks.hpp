/// The ranks of a program: one, unless mpirun or srun has started several. This header does not
/// include MPI's, and also exists in builds without MPI, which have one rank.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>

namespace phyxel {

class MpiCommunicator;

/// The handle of a caller's MPI communicator, from MPI_Comm_c2f (or mpi4py's `Comm.py2f`).
struct CommunicatorHandle {
  int fortran = 0;
};

/// The ranks of a program, or of a communicator of its own. They use a duplicate of the
/// communicator, so that the caller's messages and error handlers are not affected. Functions are
/// collective (all ranks call them in the same order, on the thread that constructed the object),
/// except `rank`, `size`, `leads` and those of the host. An error of a single rank must leave
/// through `on_ranks`, which ends the other ranks.
class Ranks {
 public:
  /// The ranks of a program, from the arguments of main(). Starts MPI unless the program has. Ranks
  /// of one host share its memory, in the checks before a model is built, and its cores, unless
  /// they are bound or OMP_NUM_THREADS is set.
  /// @throws Error if MPI does not start, if its thread level is below MPI_THREAD_FUNNELED, or if
  /// there
  ///   are several ranks in a build without MPI
  Ranks(int& argc, char**& argv);
  /// The ranks of a communicator of a program that has started MPI. Collective over it.
  /// @throws Error if MPI's thread level is below MPI_THREAD_FUNNELED
  explicit Ranks(CommunicatorHandle callers);
  /// One rank, without MPI.
  Ranks();
  /// Local: neither releases the duplicate nor ends MPI.
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  /// Releases the duplicate, and ends MPI if the constructor has started it. `on_ranks` calls it; a
  /// program without `on_ranks` calls it last.
  void close();

  /// Number of this rank, from 0.
  int rank() const;
  /// Number of ranks.
  int size() const;
  /// True on the first rank, which prints for all.
  bool leads() const { return rank() == 0; }
  /// Number of ranks on this host.
  int host_size() const;
  /// Number of this rank among those of its host, from 0.
  int host_rank() const;

  /// Waits for all ranks.
  void barrier() const;
  /// Sum over all ranks.
  std::int64_t sum(std::int64_t value) const;
  /// Maximum over all ranks.
  std::int64_t largest(std::int64_t value) const;
  /// Minimum over all ranks.
  std::int64_t smallest(std::int64_t value) const;
  /// Maximum over all ranks.
  double largest(double value) const;
  /// Minimum over all ranks.
  double smallest(double value) const;
  /// Sum of the terms of all ranks, rounded once, so that the bits do not depend on the
  /// distribution of the terms over ranks, nor on their order. NaN if a term is not finite.
  double exact_sum(std::span<const double> terms) const;

  /// Runs `work`, which must not communicate, on each rank, and then agrees on the outcome.
  /// @throws Error on each rank if `work` threw on any, with the message and the exit code of the
  /// first
  ///   rank that failed; with one rank, what `work` threw
  void collectively(const std::function<void()>& work) const;
  /// Returns `make()`, which must not communicate. @throws Error as `collectively`
  template <class Make>
  auto agreed(Make&& make) const {
    std::optional<decltype(make())> made;
    collectively([&] { made.emplace(make()); });
    return std::move(*made);
  }

  /// The communicator of the library.
  const MpiCommunicator& communicator() const { return *communicator_; }

 private:
  void share_host() const;

  std::unique_ptr<MpiCommunicator> communicator_;
};

/// Runs a program on its ranks. An exception that leaves `program` ends all ranks with one message
/// on stderr, "name: error: ...", with the name of argv[0]. If the ranks have agreed on the error,
/// all return; an error of one rank ends the others at once, and its message names the rank.
/// @returns the exit code for main(): the result of `program`, the code of an Error, or that of
///   bad_input for another exception
int on_ranks(int& argc, char**& argv, const std::function<int(const Ranks&)>& program);

}  // namespace phyxel
