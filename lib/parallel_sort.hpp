/// Sorting on all threads.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

namespace phyxel {

/// Each thread sorts a piece, then pairs of neighbours are merged. Not stable.
template <class T, class Less = std::less<>>
void parallel_sort(std::vector<T>& values, Less less = {}) {
  constexpr std::size_t least = 1 << 16;  // a thread
  std::size_t pieces = 1;
  while (pieces < static_cast<std::size_t>(omp_get_max_threads()) &&
         values.size() / pieces > least) {
    pieces *= 2;
  }
  const auto at = [&](std::size_t piece) {
    return values.begin() + static_cast<std::ptrdiff_t>(values.size() * piece / pieces);
  };
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t p = 0; p < pieces; ++p) std::sort(at(p), at(p + 1), less);
  for (std::size_t width = 1; width < pieces; width *= 2) {
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t p = 0; p < pieces; p += 2 * width) {
      std::inplace_merge(at(p), at(p + width), at(p + 2 * width), less);
    }
  }
}

}  // namespace phyxel
