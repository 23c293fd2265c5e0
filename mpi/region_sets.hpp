/// The sets of regions that phyxels are in, numbered, so that a phyxel carries one number however
/// many regions a scene names.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "mpi/communicator.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

class RegionSets {
 public:
  /// The regions of one set, ascending.
  using Set = std::vector<Index>;

  /// The number of the set without regions.
  static constexpr std::uint32_t none = 0;

  /// Returns the number of a set with one region more. @param region not in the set, and not below
  /// those that are
  std::uint32_t with(std::uint32_t set, Index region);
  bool contains(std::uint32_t set, Index region) const;

  /// Gives the sets of all ranks the same numbers on each of them. Collective.
  /// @param sets of each body. Returns the new number of each old one, for each body.
  static std::vector<std::vector<std::uint32_t>> agree(const MpiCommunicator& ranks,
                                                       std::vector<RegionSets>& sets);

 private:
  std::uint32_t number_of(Set set);

  std::vector<Set> sets_{Set{}};
  std::map<Set, std::uint32_t> numbers_{{Set{}, none}};
  std::map<std::pair<std::uint32_t, Index>, std::uint32_t> larger_;  // results of `with`
};

}  // namespace phyxel
