/// Numbered sets of the regions of a scene: a phyxel carries the number of its set, however many
/// regions contain it.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "mpi/communicator.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The sets of regions of the phyxels of one body.
class RegionSets {
 public:
  /// The regions of one set, ascending.
  using Set = std::vector<Index>;

  /// The number of the set without regions.
  static constexpr std::uint32_t none = 0;

  /// Returns the number of a set with one more region.
  /// @param region a number that no region of the set exceeds
  std::uint32_t with(std::uint32_t set, Index region);
  /// True if the set has the region.
  bool contains(std::uint32_t set, Index region) const;

  /// Numbers the sets of all ranks alike on every rank, and returns the new number of each of this
  /// rank's sets, by body and former number. Collective. @param sets those of each body
  static std::vector<std::vector<std::uint32_t>> agree(const MpiCommunicator& ranks,
                                                       std::vector<RegionSets>& sets);

 private:
  std::uint32_t number_of(Set set);

  std::vector<Set> sets_{Set{}};
  std::map<Set, std::uint32_t> numbers_{{Set{}, none}};
  std::map<std::pair<std::uint32_t, Index>, std::uint32_t> larger_;  // results of `with`
};

}  // namespace phyxel
