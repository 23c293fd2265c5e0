#include "mpi/region_sets.hpp"

#include <algorithm>
#include <span>
#include <utility>

namespace phyxel {

std::uint32_t RegionSets::number_of(Set set) {
  const auto [at, is_new] = numbers_.try_emplace(set, static_cast<std::uint32_t>(sets_.size()));
  if (is_new) sets_.push_back(std::move(set));
  return at->second;
}

std::uint32_t RegionSets::with(std::uint32_t set, Index region) {
  const auto known = larger_.find({set, region});
  if (known != larger_.end()) return known->second;
  Set larger = sets_[set];
  larger.push_back(region);
  return larger_[{set, region}] = number_of(std::move(larger));
}

bool RegionSets::contains(std::uint32_t set, Index region) const {
  return std::binary_search(sets_[set].begin(), sets_[set].end(), region);
}

std::vector<std::vector<std::uint32_t>> RegionSets::agree(const MpiCommunicator& ranks,
                                                          std::vector<RegionSets>& sets) {
  // The body, the number of regions, and the regions of each set.
  std::vector<Index> here;
  for (std::size_t b = 0; b < sets.size(); ++b) {
    for (const Set& set : sets[b].sets_) {
      here.push_back(static_cast<Index>(b));
      here.push_back(static_cast<Index>(set.size()));
      here.insert(here.end(), set.begin(), set.end());
    }
  }
  const std::vector<Index> all = ranks.gathered(std::span(std::as_const(here)));
  std::vector<RegionSets> agreed(sets.size());
  for (auto at = all.begin(); at != all.end();) {
    const Index body = *at++, size = *at++;
    agreed[body].number_of({at, at + size});
    at += size;
  }
  std::vector<std::vector<std::uint32_t>> renumbered(sets.size());
  for (std::size_t b = 0; b < sets.size(); ++b) {
    for (const Set& set : sets[b].sets_) renumbered[b].push_back(agreed[b].numbers_.at(set));
  }
  sets = std::move(agreed);
  return renumbered;
}

}  // namespace phyxel
