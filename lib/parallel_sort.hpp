/// Sorting on all threads.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "bulk.hpp"

namespace phyxel {

/// Sample sort: samples divide the values into more buckets than threads, which are sorted
/// separately. Not stable.
template <class Vector, class Less = std::less<>>
void parallel_sort(Vector& values, Less less = {}) {
  using T = typename Vector::value_type;
  constexpr std::size_t least = 1 << 16, samples = 32;  // values per thread; samples per bucket
  const std::size_t n = values.size();
  const std::size_t threads =
      std::min({static_cast<std::size_t>(omp_get_max_threads()), n / least, std::size_t{4096}});
  if (threads < 2) return std::sort(values.begin(), values.end(), less);
  const std::size_t buckets = 8 * threads;
  Bulk<T> ends;  // samples, then the first value of each bucket but the first
  for (std::size_t k = 0; k < buckets * samples; ++k) {
    ends.push_back(values[n * k / (buckets * samples)]);
  }
  std::sort(ends.begin(), ends.end(), less);
  for (std::size_t b = 1; b < buckets; ++b) ends[b - 1] = ends[b * samples];
  ends.resize(buckets - 1);

  // Each thread has a range of values, for which it counts the values of each bucket.
  const auto begin_of = [&](std::size_t stretch) { return n * stretch / threads; };
  Bulk<std::uint16_t> bucket(n);
  std::vector<std::vector<std::size_t>> at(threads, std::vector<std::size_t>(buckets, 0));
#pragma omp parallel for schedule(static, 1)
  for (std::size_t t = 0; t < threads; ++t) {
    for (std::size_t k = begin_of(t); k < begin_of(t + 1); ++k) {
      bucket[k] = static_cast<std::uint16_t>(
          std::upper_bound(ends.begin(), ends.end(), values[k], less) - ends.begin());
      ++at[t][bucket[k]];
    }
  }
  std::vector<std::size_t> begin{0};
  for (std::size_t b = 0, next = 0; b < buckets; ++b) {
    for (std::size_t t = 0; t < threads; ++t) {
      const std::size_t count = at[t][b];
      at[t][b] = next;
      next += count;
    }
    begin.push_back(next);
  }
  Bulk<T> sorted(n);
#pragma omp parallel for schedule(static, 1)
  for (std::size_t t = 0; t < threads; ++t) {
    for (std::size_t k = begin_of(t); k < begin_of(t + 1); ++k) {
      sorted[at[t][bucket[k]]++] = values[k];
    }
  }
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t b = 0; b < buckets; ++b) {
    T* const first = sorted.data() + begin[b];
    T* const last = sorted.data() + begin[b + 1];
    std::sort(first, last, less);
    std::copy(first, last, values.data() + begin[b]);
  }
}

}  // namespace phyxel
