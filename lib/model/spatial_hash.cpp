#include "model/spatial_hash.hpp"

#include <omp.h>

#include <algorithm>
#include <bit>

#include "model/box.hpp"

namespace phyxel {

SpatialHash::SpatialHash(std::span<const Vec3d> position, double cell_size) {
  const std::size_t n = position.size();
  const Box box = box_around(position);
  grid_.low = box.low;
  high_ = box.high;
  cell_size_ = cell_size_for(grid_.low, high_, cell_size);
  grid_.inverse_cell_size = 1 / cell_size_;

  const std::size_t table_size = std::bit_ceil(std::max<std::size_t>(n, 8));
  grid_.table_mask = table_size - 1;
  Bulk<std::uint64_t> cell(n);
  Bulk<std::uint32_t> bucket(n);
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < n; ++i) {
    cell[i] = CellGrid::name(grid_.cell_of(position[i]));
    bucket[i] = static_cast<std::uint32_t>(grid_.bucket_of(cell[i]));
  }
  bucket_start_.resize(table_size + 1);
  bucket_start_[0] = 0;
  entries_.resize(n);
  // Each thread has a stretch of the buckets, and fills them in the order of the points.
  Bulk<std::uint32_t> next(table_size);
  std::vector<std::size_t> before(static_cast<std::size_t>(omp_get_max_threads()) + 1, 0);
#pragma omp parallel
  {
    const auto thread = static_cast<std::size_t>(omp_get_thread_num()),
               threads = static_cast<std::size_t>(omp_get_num_threads());
    const std::size_t first = table_size * thread / threads,
                      last = table_size * (thread + 1) / threads;
    const auto for_each_point = [&](auto&& visit) {
      for (std::size_t i = 0; i < n; ++i) {
        if (bucket[i] >= first && bucket[i] < last) visit(i);
      }
    };
    for (std::size_t b = first; b < last; ++b) bucket_start_[b + 1] = 0;
    for_each_point([&](std::size_t i) { ++bucket_start_[bucket[i] + 1]; });
    for (std::size_t b = first; b < last; ++b) before[thread + 1] += bucket_start_[b + 1];
#pragma omp barrier
    std::size_t at = 0;
    for (std::size_t t = 0; t <= thread; ++t) at += before[t];
    for (std::size_t b = first; b < last; ++b) {
      next[b] = static_cast<std::uint32_t>(at);
      at += bucket_start_[b + 1];
      bucket_start_[b + 1] = static_cast<std::uint32_t>(at);
    }
    for_each_point([&](std::size_t i) {
      entries_[next[bucket[i]]++] = {position[i], cell[i], static_cast<Index>(i)};
    });
  }
  // Within a bucket the points of one cell need not be adjacent; counting changes of cell
  // overestimates a little, which is good enough for an estimate.
  std::size_t occupied = 0;
#pragma omp parallel for schedule(static) reduction(+ : occupied)
  for (std::size_t b = 0; b < table_size; ++b) {
    for (std::uint32_t k = bucket_start_[b]; k < bucket_start_[b + 1]; ++k) {
      occupied += k == bucket_start_[b] || entries_[k].cell != entries_[k - 1].cell;
    }
  }
  mean_occupancy_ = occupied ? static_cast<double>(n) / static_cast<double>(occupied) : 0;
}

}  // namespace phyxel
