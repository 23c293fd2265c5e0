#include "model/spatial_hash.hpp"

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
  bucket_start_.assign(table_size + 1, 0);
  std::vector<std::uint64_t> cell(n);
  for (std::size_t i = 0; i < n; ++i) {
    cell[i] = CellGrid::name(grid_.cell_of(position[i]));
    ++bucket_start_[grid_.bucket_of(cell[i]) + 1];
  }
  for (std::size_t b = 0; b < table_size; ++b) bucket_start_[b + 1] += bucket_start_[b];
  std::vector<std::uint32_t> next(bucket_start_.begin(), bucket_start_.end() - 1);
  entries_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    entries_[next[grid_.bucket_of(cell[i])]++] = {position[i], cell[i], static_cast<Index>(i)};
  }
  // Within a bucket the points of one cell need not be adjacent; counting changes of cell
  // overestimates a little, which is good enough for an estimate.
  std::size_t occupied = 0;
  for (std::size_t b = 0; b < table_size; ++b) {
    for (std::uint32_t k = bucket_start_[b]; k < bucket_start_[b + 1]; ++k) {
      occupied += k == bucket_start_[b] || entries_[k].cell != entries_[k - 1].cell;
    }
  }
  mean_occupancy_ = occupied ? static_cast<double>(n) / static_cast<double>(occupied) : 0;
}

}  // namespace phyxel
