/// Values of the whole model, a stretch at a time: from all ranks to the first one, which writes
/// them, and back.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mpi/communicator.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"
#include "phyxel/stretches.hpp"

namespace phyxel {

class StretchExchange {
 public:
  /// @param share must outlive this
  StretchExchange(const Communicator& ranks, const Model& share);

  /// Those of the whole model's phyxels, or surfels, `begin` to `end` on the first rank; nothing on
  /// the others. Collective.
  /// @param here of all phyxels or surfels of this rank
  std::vector<double> gathered(Quantity quantity, std::span<const double> here, Index begin,
                               Index end) const;

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
    Range within(Index begin, Index end) const;
  };
  template <class Wanted>
  static Places places_of(const std::vector<Index>& numbers, Wanted&& wanted);

  const Communicator& ranks_;
  const Model& share_;
  Places own_, surfels_;
};

}  // namespace phyxel
