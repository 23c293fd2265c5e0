/// The ranks of a program: one, unless mpirun or srun has started several. No MPI header is needed
/// to include this, and a build without MPI has it too: it then has one rank.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>

namespace phyxel {

class MpiCommunicator;

/// An MPI communicator of the caller's, as MPI_Comm_c2f (or mpi4py's `Comm.py2f`) names it.
struct CommunicatorHandle {
  int fortran = 0;
};

/// The ranks of a program, or of a communicator of its own. They talk in a duplicate of the
/// communicator: neither the caller's messages nor its handling of errors are touched. Every
/// function but `rank`, `size`, `leads` and those of the host is collective: all ranks call it, in
/// the same order, each by the thread that constructed it. An error that one rank meets alone has
/// to leave through `on_ranks`, which ends the others.
class Ranks {
 public:
  /// Of a program whose main() was given these. Ranks of one host share its memory in the checks
  /// before a model is built, and its cores, unless someone has bound them or has set
  /// OMP_NUM_THREADS. MPI starts unless the program has started it.
  /// @throws Error if MPI does not start, or supports fewer threads than MPI_THREAD_FUNNELED, or if
  ///   there are several ranks in a build without it
  Ranks(int& argc, char**& argv);
  /// Of a communicator of a program that has started MPI. Collective over it.
  /// @throws Error if MPI was started for fewer threads than MPI_THREAD_FUNNELED
  explicit Ranks(CommunicatorHandle callers);
  /// One rank, without MPI.
  Ranks();
  /// Local: ends nothing.
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  /// Releases the duplicate, and ends MPI if the constructor has started it; `on_ranks` calls it.
  /// A program that holds `Ranks` itself calls it last.
  void close();

  /// Which one this is, from 0.
  int rank() const;
  /// How many there are.
  int size() const;
  /// Whether this rank speaks for all: the first one.
  bool leads() const { return rank() == 0; }
  /// Ranks of this host.
  int host_size() const;
  /// Which of them this is, from 0.
  int host_rank() const;

  /// Waits for all.
  void barrier() const;
  /// Σ over all ranks.
  std::int64_t sum(std::int64_t value) const;
  /// Over all ranks.
  std::int64_t largest(std::int64_t value) const;
  /// Over all ranks.
  std::int64_t smallest(std::int64_t value) const;
  /// Over all ranks.
  double largest(double value) const;
  /// Over all ranks.
  double smallest(double value) const;
  /// Of the terms of all ranks, rounded once: the same bits however many ranks share the terms, and
  /// in whatever order. NaN if a term is not finite.
  double exact_sum(std::span<const double> terms) const;

  /// Does the work of this rank, which must not communicate; then all agree how it went.
  /// @throws Error on every rank if it threw on any, with the message and the exit code of the
  ///   first rank that failed; what it threw, if there is one rank
  void collectively(const std::function<void()>& work) const;
  /// `make()`, which must not communicate, on every rank. @throws Error as `collectively`
  template <class Make>
  auto agreed(Make&& make) const {
    std::optional<decltype(make())> made;
    collectively([&] { made.emplace(make()); });
    return std::move(*made);
  }

  /// What the library's own parts talk through.
  const MpiCommunicator& communicator() const { return *communicator_; }

 private:
  void share_host() const;

  std::unique_ptr<MpiCommunicator> communicator_;
};

/// Runs a program on its ranks, and returns its exit code for main() to return. An exception that
/// leaves `program` ends all ranks with one message on stderr, "name: error: ...", where the name
/// is that of argv[0]: if all ranks have agreed on it, they return; what one alone has met ends the
/// others at once, and is told with its rank.
/// @returns what `program` returns; of an Error its code; else that of bad_input
int on_ranks(int& argc, char**& argv, const std::function<int(const Ranks&)>& program);

}  // namespace phyxel
