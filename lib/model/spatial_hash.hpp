/// The spatial hash of Teschner et al. 2003 (reference 30 of Farias et al. 2008).
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Points in the buckets of a hash table, by the grid cell they lie in. Building it and visiting
/// the points near a place are linear in the number of points; the extent of the cloud, and holes
/// in it, cost nothing.
class SpatialHash {
 public:
  /// A point as the table holds it: bucket by bucket, so that a visit reads memory in order.
  struct Entry {
    Vec3d position;
    std::uint64_t cell;
    Index index;
  };

  SpatialHash(std::span<const Vec3d> position, double cell_size);

  double cell_size() const { return cell_size_; }
  /// Mean number of points in a cell that holds any.
  double mean_occupancy() const { return mean_occupancy_; }

  /// Calls visit(entry) once for every point.
  template <class Visit>
  void visit_all(Visit&& visit) const {
    for (const Entry& entry : entries_) visit(entry);
  }

  /// Calls visit(entry) once for (at least) every point nearer to `place` than `rings` cells. Where
  /// that would be more cells than there are points, it visits the points.
  template <class Visit>
  void visit_near(Vec3d place, int rings, Visit&& visit) const {
    const double width = 2.0 * rings + 1;
    if (rings > 3 && width * width * width > static_cast<double>(entries_.size())) {
      visit_all(visit);
      return;
    }
    const Cell c = cell_of(place);
    for (std::int64_t z = c.z - rings; z <= c.z + rings; ++z) {
      for (std::int64_t y = c.y - rings; y <= c.y + rings; ++y) {
        for (std::int64_t x = c.x - rings; x <= c.x + rings; ++x) visit_cell({x, y, z}, visit);
      }
    }
  }

  /// The same for the cells exactly `ring` cells away.
  template <class Visit>
  void visit_ring(Vec3d place, int ring, Visit&& visit) const {
    const Cell c = cell_of(place);
    for (std::int64_t dz = -ring; dz <= ring; ++dz) {
      for (std::int64_t dy = -ring; dy <= ring; ++dy) {
        const bool face = std::abs(dz) == ring || std::abs(dy) == ring;
        const std::int64_t stride = face || ring == 0 ? 1 : 2 * ring;
        for (std::int64_t dx = -ring; dx <= ring; dx += stride) {
          visit_cell({c.x + dx, c.y + dy, c.z + dz}, visit);
        }
      }
    }
  }

  /// Rings of cells around `place` beyond which there is no point.
  int farthest_ring(Vec3d place) const;

 private:
  struct Cell {
    std::int64_t x, y, z;
  };

  Cell cell_of(Vec3d p) const {
    return {static_cast<std::int64_t>(std::floor((p.x - low_.x) * inverse_cell_size_)),
            static_cast<std::int64_t>(std::floor((p.y - low_.y) * inverse_cell_size_)),
            static_cast<std::int64_t>(std::floor((p.z - low_.z) * inverse_cell_size_))};
  }
  /// A cell's name: 21 bits a coordinate. Cells outside the cloud may share the name of one
  /// inside only if they are two million cells away, and then the distance tells.
  static std::uint64_t name(Cell c) {
    constexpr std::uint64_t mask = 0x1fffff;
    return (static_cast<std::uint64_t>(c.x) & mask) |
           (static_cast<std::uint64_t>(c.y) & mask) << 21 |
           (static_cast<std::uint64_t>(c.z) & mask) << 42;
  }
  /// hash(x, y, z) = (x p1 xor y p2 xor z p3) mod table size, with the paper's primes.
  std::size_t bucket_of(std::uint64_t cell) const {
    constexpr std::uint64_t mask = 0x1fffff;
    const std::uint64_t h = ((cell & mask) * 73856093u) ^ ((cell >> 21 & mask) * 19349663u) ^
                            ((cell >> 42 & mask) * 83492791u);
    return h & table_mask_;
  }
  template <class Visit>
  void visit_cell(Cell c, Visit&& visit) const {
    const std::uint64_t cell = name(c);
    const std::size_t bucket = bucket_of(cell);
    for (std::uint32_t k = bucket_start_[bucket]; k < bucket_start_[bucket + 1]; ++k) {
      if (entries_[k].cell == cell) visit(entries_[k]);
    }
  }

  Vec3d low_, high_;
  double cell_size_ = 1, inverse_cell_size_ = 1, mean_occupancy_ = 0;
  std::size_t table_mask_ = 0;
  std::vector<std::uint32_t> bucket_start_;
  std::vector<Entry> entries_;
};

}  // namespace phyxel
