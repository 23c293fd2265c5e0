/// Arrays filled on all threads.
#pragma once

#include <cstddef>
#include <vector>

namespace phyxel {

/// f(0) to f(n - 1).
template <class F>
auto tabulated(std::size_t n, F&& f) {
  std::vector<decltype(f(std::size_t{0}))> values(n);
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < n; ++k) values[k] = f(k);
  return values;
}

/// What add(sum, k) adds for k from `begin` to `end` in any order: to sums without rounding, which
/// may be added to each other.
template <class Sum, class Number, class Add>
Sum added_up(Number begin, Number end, Add&& add) {
  Sum all{};
#pragma omp parallel
  {
    Sum mine{};
#pragma omp for schedule(static) nowait
    for (Number k = begin; k < end; ++k) add(mine, k);
#pragma omp critical
    all.add(mine);
  }
  return all;
}

}  // namespace phyxel
