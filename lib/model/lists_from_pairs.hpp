/// Lists made from pairs.
#pragma once

#include <cstddef>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Sets the starts of lists and their values from pairs of a list and a value; each list keeps the
/// order of the pairs.
template <class Pairs, class Value>
void group(std::size_t lists, const Pairs& pairs, std::vector<Offset>& start,
           std::vector<Value>& values) {
  start.assign(lists + 1, 0);
  for (const auto& [list, value] : pairs) ++start[static_cast<std::size_t>(list) + 1];
  for (std::size_t k = 0; k < lists; ++k) start[k + 1] += start[k];
  values.resize(pairs.size());
  std::vector<Offset> next(start.begin(), start.end() - 1);
  for (const auto& [list, value] : pairs) values[next[list]++] = value;
}

}  // namespace phyxel
