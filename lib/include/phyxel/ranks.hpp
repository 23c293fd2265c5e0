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

class Communicator;

/// One for the whole program: MPI starts with it and ends with it, unless the program has started
/// it itself. Every function but `rank`, `size`, `leads` and those of the host is collective: all
/// ranks call it, in the same order. An error that one rank meets alone has to leave through
/// `on_ranks`, which ends the others.
class Ranks {
 public:
  /// Of a program whose main() was given these. Ranks of one host share its memory in the checks
  /// before a model is built, and its cores, unless someone has bound them or has set
  /// OMP_NUM_THREADS.
  /// @throws Error if MPI does not start, or there are several ranks in a build without it
  Ranks(int& argc, char**& argv);
  /// One rank, without MPI.
  Ranks();
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

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
  void together(const std::function<void()>& work) const;
  /// `make()`, which must not communicate, on every rank. @throws Error as `together`
  template <class Make>
  auto agreed(Make&& make) const {
    std::optional<decltype(make())> made;
    together([&] { made.emplace(make()); });
    return std::move(*made);
  }

  /// What the library's own parts talk through.
  const Communicator& communicator() const { return *communicator_; }

 private:
  std::unique_ptr<const Communicator> communicator_;
};

/// Runs a program on its ranks, and returns its exit code for main() to return. An exception that
/// leaves `program` ends all ranks with one message on stderr, "name: error: ...", where the name
/// is that of argv[0]: if all ranks have agreed on it, they return; what one alone has met ends the
/// others at once, and is told with its rank.
/// @returns what `program` returns; of an Error its code; else that of bad_input
int on_ranks(int& argc, char**& argv, const std::function<int(const Ranks&)>& program);

}  // namespace phyxel
