/// Sorting on all threads.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

namespace phyxel {

/// Each thread sorts a piece; samples of the pieces cut what there is into as many stretches, which
/// the threads bring together and sort again. Not stable.
template <class T, class Less = std::less<>>
void parallel_sort(std::vector<T>& values, Less less = {}) {
  constexpr std::size_t least = 1 << 16, samples = 64;  // of a piece
  const std::size_t pieces =
      std::min(static_cast<std::size_t>(omp_get_max_threads()), values.size() / least);
  if (pieces < 2) return std::sort(values.begin(), values.end(), less);
  const auto at = [&](std::size_t piece) {
    return values.begin() + static_cast<std::ptrdiff_t>(values.size() * piece / pieces);
  };
#pragma omp parallel for schedule(static, 1)
  for (std::size_t p = 0; p < pieces; ++p) std::sort(at(p), at(p + 1), less);

  std::vector<T> sample;
  for (std::size_t p = 0; p < pieces; ++p) {
    const auto length = static_cast<std::size_t>(at(p + 1) - at(p));
    for (std::size_t k = 0; k < samples; ++k) {
      sample.push_back(at(p)[static_cast<std::ptrdiff_t>(length * k / samples)]);
    }
  }
  std::sort(sample.begin(), sample.end(), less);
  // Where stretch s begins in piece p.
  std::vector<typename std::vector<T>::iterator> cut((pieces + 1) * pieces);
  std::vector<std::size_t> begin(pieces + 1, 0);
  for (std::size_t s = 0; s <= pieces; ++s) {
    for (std::size_t p = 0; p < pieces; ++p) {
      cut[s * pieces + p] = s == 0 ? at(p)
                            : s == pieces
                                ? at(p + 1)
                                : std::lower_bound(at(p), at(p + 1), sample[s * samples], less);
      begin[s] += static_cast<std::size_t>(cut[s * pieces + p] - at(p));
    }
  }
  std::vector<T> sorted(values.size());
#pragma omp parallel for schedule(static, 1)
  for (std::size_t s = 0; s < pieces; ++s) {
    const auto first = sorted.begin() + static_cast<std::ptrdiff_t>(begin[s]);
    auto last = first;
    for (std::size_t p = 0; p < pieces; ++p) {
      last = std::copy(cut[s * pieces + p], cut[(s + 1) * pieces + p], last);
    }
    std::sort(first, last, less);
  }
  values.swap(sorted);
}

}  // namespace phyxel
