/// A table of points on the device, with the searches of the host's.
#pragma once

#include <span>

#include "model/cell_search.hpp"
#include "setup/device_hash.cuh"

namespace phyxel::cuda {

/// The table as kernels see it: a hash of one body.
struct TableView : CellSearch<TableView> {
  /// A point as visits see it.
  struct Entry {
    Vec3d position;
    Index index;
  };

  HashView hash;

  PHYXEL_HD explicit TableView(const HashView& of) : hash(of) {}
  PHYXEL_HD const CellGrid& grid() const { return hash.bodies->grid; }
  PHYXEL_HD Vec3d high() const { return hash.bodies->high; }
  PHYXEL_HD double cell_size() const { return hash.bodies->cell_size; }
  PHYXEL_HD std::size_t points() const { return static_cast<std::size_t>(hash.points); }

  template <class Visit>
  PHYXEL_HD void visit_all(Visit&& visit) const {
    for (Index k = 0; k < hash.points; ++k) visit(Entry{hash.entries[k].position, hash.index[k]});
  }
  template <class Visit>
  PHYXEL_HD void visit_cell(CellGrid::Cell c, Visit&& visit) const {
    const std::uint64_t cell = CellGrid::name(c), bucket = grid().bucket_of(cell);
    const std::uint32_t end = hash.bucket_start[bucket + 1];
    for (std::uint32_t k = hash.bucket_start[bucket]; k < end; ++k) {
      const HashView::Entry entry = hash.entries[k];
      if (entry.cell == cell) visit(Entry{entry.position, hash.index[k]});
    }
  }
};

/// A table of points on the device. Points in a cell are in the order of their indices, as on the
/// host.
class DeviceTable {
 public:
  /// @param point positions on the device, one at least [m]. @param cell_size as `SpatialHash` [m]
  DeviceTable(const DeviceArray<Vec3d>& point, double cell_size)
      : DeviceTable(point, box_around(point, 0, static_cast<Index>(point.size())), cell_size) {}

  TableView view() const { return TableView(hash_.view()); }
  double cell_size() const { return cell_size_; }
  double mean_occupancy() const { return hash_.mean_occupancy(); }

 private:
  DeviceTable(const DeviceArray<Vec3d>& point, const Box& box, double cell_size)
      : cell_size_(cell_size_for(box.low, box.high, cell_size)), hash_(point, box, cell_size) {}

  double cell_size_;
  DeviceHash hash_;
};

/// The values of a span, on the device.
template <class T>
DeviceArray<T> sent(std::span<const T> values, const std::string& what) {
  DeviceArray<T> array(values.size(), what);
  array.upload(values.data());
  return array;
}

}  // namespace phyxel::cuda
