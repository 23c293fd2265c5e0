/// Arrays filled on all threads.
#pragma once

#include <omp.h>

#include <cstddef>
#include <vector>

#include "bulk.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

template <class Vector, class F>
Vector filled(std::size_t n, F&& f) {
  Vector values(n);
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < n; ++k) values[k] = f(k);
  return values;
}

/// The values f(0) to f(n - 1).
template <class F>
auto tabulated(std::size_t n, F&& f) {
  return filled<std::vector<decltype(f(std::size_t{0}))>>(n, f);
}
/// The values f(0) to f(n - 1) in a `Bulk`, for large temporary arrays.
template <class F>
auto in_bulk(std::size_t n, F&& f) {
  return filled<Bulk<decltype(f(std::size_t{0}))>>(n, f);
}

/// The indices from `begin` to `end` for which `wants` is true, ascending.
/// @param wants is called twice for each index
template <class Wants>
std::vector<Index> chosen(Index begin, Index end, Wants&& wants) {
  const auto stretches = static_cast<std::size_t>(omp_get_max_threads());
  const auto first_of = [&](std::size_t s) {
    return begin + static_cast<Index>(static_cast<std::size_t>(end - begin) * s / stretches);
  };
  std::vector<std::size_t> before(stretches + 1, 0);
#pragma omp parallel for schedule(static, 1)
  for (std::size_t s = 0; s < stretches; ++s) {
    std::size_t found = 0;
    for (Index i = first_of(s); i < first_of(s + 1); ++i) found += wants(i) ? 1 : 0;
    before[s + 1] = found;
  }
  for (std::size_t s = 0; s < stretches; ++s) before[s + 1] += before[s];
  std::vector<Index> all(before.back());
#pragma omp parallel for schedule(static, 1)
  for (std::size_t s = 0; s < stretches; ++s) {
    std::size_t at = before[s];
    for (Index i = first_of(s); i < first_of(s + 1); ++i) {
      if (wants(i)) all[at++] = i;
    }
  }
  return all;
}

/// The sum by add(sum, k) for k from `begin` to `end`, in any order: `Sum` must be without
/// rounding, so that partial sums can be added.
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
