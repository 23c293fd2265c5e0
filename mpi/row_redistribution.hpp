/// Redistribution of rows: from shares, which have the values of their phyxels in their own order,
/// to ranges of the whole model's rows, and back.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mpi/communicator.hpp"
#include "phyxel/chunked_source.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Range [begin, end) of global ids of phyxels or surfels.
struct RowRange {
  Index begin = 0, end = 0;
};

class RowRedistribution {
 public:
  /// @param share must outlive this object
  RowRedistribution(const MpiCommunicator& ranks, const Model& share);

  /// Returns the values of this rank's range. Collective.
  /// @param here values of the phyxels or surfels of this rank's share
  /// @param wanted the range of each rank
  std::vector<double> redistributed(Quantity quantity, std::span<const double> here,
                                    std::span<const RowRange> wanted) const;
  /// Returns the values of one range on the first rank, and nothing on other ranks. Collective.
  std::vector<double> gathered(Quantity quantity, std::span<const double> here,
                               RowRange wanted) const;

  /// Returns this rank's share of a state that the first rank reads in ranges of at most `length`
  /// phyxels. Collective. @param read returns the state of a range; called on the first rank
  State scattered(Index length, const std::function<State(Index begin, Index end)>& read) const;

 private:
  /// Map from global ids to indices of the share.
  struct Places {
    std::vector<Index> number, here;  // global id, ascending, and index in the share

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
