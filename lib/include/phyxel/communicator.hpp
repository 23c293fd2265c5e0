/// The ranks of a program, as the solver and the backends see them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace phyxel {

/// Reductions and exchanges between ranks. Every function but `rank` and `size` is collective: all
/// ranks call it, in the same order.
class Communicator {
 public:
  virtual ~Communicator() = default;

  /// The number of this rank, from 0.
  virtual int rank() const = 0;
  /// The number of ranks.
  virtual int size() const = 0;

  /// Sums `values` over all ranks, element by element, in place.
  virtual void add(std::span<std::int64_t> values) const = 0;
  /// The maximum of `value` over all ranks.
  virtual double largest(double value) const = 0;
  /// The minimum of `value` over all ranks.
  virtual double smallest(double value) const = 0;

  /// All-to-all exchange: sends `words[r]` to rank r and returns the bytes received from each rank.
  virtual std::vector<std::vector<std::byte>> alltoallv(
      const std::vector<std::vector<std::byte>>& words) const = 0;
};

}  // namespace phyxel
