/// Redistribution of rows: the values of a share's phyxels, which each rank has in its own order,
/// to ranks that want ranges of the whole model's, and back.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mpi/communicator.hpp"
#include "phyxel/chunked_source.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Phyxels, or surfels, [begin, end) of the whole model.
struct RowRange {
  Index begin = 0, end = 0;
};

class RowRedistribution {
 public:
  /// @param share must outlive this
  RowRedistribution(const MpiCommunicator& ranks, const Model& share);

  /// The values of the range that this rank wants. Collective.
  /// @param here values of all phyxels or surfels of this rank
  /// @param wanted the range that each rank wants
  std::vector<double> redistributed(Quantity quantity, std::span<const double> here,
                                    std::span<const RowRange> wanted) const;
  /// The same, on the first rank alone.
  std::vector<double> gathered(Quantity quantity, std::span<const double> here,
                               RowRange wanted) const;

  /// This rank's share of a state, at most `length` phyxels of which are in any other memory.
  /// Collective.
  /// @param read the state of some phyxels of the whole; called on the first rank
  State scattered(Index length, const std::function<State(Index begin, Index end)>& read) const;

 private:
  /// Where some of the whole model's phyxels, or surfels, are here.
  struct Places {
    std::vector<Index> number, here;  // by number

    struct Range {
      std::size_t begin, end;
    };
    Range within(RowRange range) const;
  };
  template <class Wanted>
  static Places places_of(const std::vector<Index>& numbers, Wanted&& wanted);

  const MpiCommunicator& ranks_;
  const Model& share_;
  Places own_, surfels_;
};

}  // namespace phyxel
