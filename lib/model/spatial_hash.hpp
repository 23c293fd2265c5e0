/// The spatial hash of Teschner et al. 2003 on the CPU.
#pragma once

#include <cstdint>
#include <span>

#include "bulk.hpp"
#include "model/cell_search.hpp"

namespace phyxel {

/// Points in the buckets of a hash table, by the grid cell they lie in. Building it and visiting
/// the points near a place are linear in the number of points; the extent of the cloud, and holes
/// in it, cost nothing.
class SpatialHash : public CellSearch<SpatialHash> {
 public:
  /// A point as the table holds it: bucket by bucket, so that a visit reads memory in order.
  struct Entry {
    Vec3d position;
    std::uint64_t cell;
    Index index;
  };

  SpatialHash(std::span<const Vec3d> position, double cell_size);

  double cell_size() const { return cell_size_; }
  const CellGrid& grid() const { return grid_; }
  Vec3d high() const { return high_; }  ///< The upper corner of the points' box [m].
  std::size_t points() const { return entries_.size(); }
  /// Mean number of points in a cell that holds any.
  double mean_occupancy() const { return mean_occupancy_; }

  /// Calls visit(entry) once for every point.
  template <class Visit>
  void visit_all(Visit&& visit) const {
    for (const Entry& entry : entries_) visit(entry);
  }
  /// The same for the points of a cell.
  template <class Visit>
  void visit_cell(CellGrid::Cell c, Visit&& visit) const {
    const std::uint64_t cell = CellGrid::name(c);
    const std::size_t bucket = grid_.bucket_of(cell);
    for (std::uint32_t k = bucket_start_[bucket]; k < bucket_start_[bucket + 1]; ++k) {
      if (entries_[k].cell == cell) visit(entries_[k]);
    }
  }

 private:
  CellGrid grid_;
  Vec3d high_;
  double cell_size_ = 1, mean_occupancy_ = 0;
  Bulk<std::uint32_t> bucket_start_;
  Bulk<Entry> entries_;
};

}  // namespace phyxel
