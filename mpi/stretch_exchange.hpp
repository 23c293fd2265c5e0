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
  StretchExchange(const MpiCommunicator& ranks, const Model& share);

  /// Some of the whole model's phyxels, or surfels.
  struct Stretch {
    Index begin = 0, end = 0;
  };
  /// The values of the stretch that this rank is to have. Collective.
  /// @param here of all phyxels or surfels of this rank
  /// @param wanted what each rank is to have
  std::vector<double> brought(Quantity quantity, std::span<const double> here,
                              std::span<const Stretch> wanted) const;
  /// The same, on the first rank alone.
  std::vector<double> gathered(Quantity quantity, std::span<const double> here,
                               Stretch wanted) const;

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
    Range within(Stretch stretch) const;
  };
  template <class Wanted>
  static Places places_of(const std::vector<Index>& numbers, Wanted&& wanted);

  const MpiCommunicator& ranks_;
  const Model& share_;
  Places own_, surfels_;
};

}  // namespace phyxel
