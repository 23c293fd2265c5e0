/// Values of all ranks in one order.
#pragma once

#include <algorithm>
#include <vector>

#include "rank_exchange.hpp"

namespace phyxel {

/// Gathers the values of all ranks, ascending. Collective.
template <class T>
std::vector<T> joined_over_ranks(const Communicator& ranks, const std::vector<T>& here) {
  std::vector<T> all;
  for (const std::vector<T>& of_rank : allgathered(ranks, here)) {
    all.insert(all.end(), of_rank.begin(), of_rank.end());
  }
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace phyxel
