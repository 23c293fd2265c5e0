/// A spatial hash on the device. The points of a bucket are in the order of their indices, so that
/// visits are deterministic. Bodies share the table; each has its own cell size.
#pragma once

#include "model/cell_grid.hpp"
#include "setup/primitives.cuh"

namespace phyxel::cuda {

/// The hash as kernels see it.
struct HashView {
  struct alignas(16) Entry {
    Vec3d position;
    std::uint64_t cell;
  };
  struct Body {
    CellGrid grid;
    double cell_size;
    Vec3d high;
    Index begin, end;  ///< Range of the body's points.
  };

  const Body* bodies;
  int body_count;
  std::uint64_t mask;
  const std::uint32_t* bucket_start;
  const Entry* entries;
  const Index* index;  ///< Point of each entry.
  Index points;

  __device__ int body_of(Index point) const {
    int first = 0, last = body_count - 1;
    while (first < last) {
      const int middle = (first + last + 1) / 2;
      if (bodies[middle].begin <= point) {
        first = middle;
      } else {
        last = middle - 1;
      }
    }
    return first;
  }
  __device__ std::uint32_t bucket_of(int body, std::uint64_t cell) const {
    const std::uint64_t h = bodies[body].grid.bucket_of(cell);
    return static_cast<std::uint32_t>((h ^ static_cast<std::uint32_t>(body) * 2654435761U) & mask);
  }

  /// Calls visit(k, position) for each entry k of the body in a cell, and for entries of another
  /// body whose cell has the same key and bucket.
  template <class Visit>
  __device__ void visit_cell(int body, CellGrid::Cell c, Visit&& visit) const {
    const std::uint64_t cell = CellGrid::name(c);
    const std::uint32_t bucket = bucket_of(body, cell);
    const std::uint32_t end = bucket_start[bucket + 1];
    for (std::uint32_t k = bucket_start[bucket]; k < end; ++k) {
      const Entry entry = entries[k];
      if (entry.cell == cell) visit(k, entry.position);
    }
  }
  template <class Visit>
  __device__ void visit_all(int body, Visit&& visit) const {
    for (Index k = 0; k < points; ++k) {
      if (is_of(body, static_cast<std::uint32_t>(k))) {
        visit(static_cast<std::uint32_t>(k), entries[k].position);
      }
    }
  }
  /// Calls visit(k, position) once for each entry k nearer to `place` than `reach`, and for some
  /// farther ones.
  template <class Visit>
  __device__ void visit_near(int body, Vec3d place, double reach, Visit&& visit) const {
    visit_part_of_near(body, place, reach, 0, 1, visit);
  }
  /// The same for one of several threads that share the cells.
  template <class Visit>
  __device__ void visit_part_of_near(int body, Vec3d place, double reach, int thread, int threads,
                                     Visit&& visit) const {
    const int rings = rings_within(reach, bodies[body].cell_size);
    const double width = 2.0 * rings + 1;
    if (rings > 3 && width * width * width > points) {  // more cells than points
      if (thread == 0) visit_all(body, visit);
      return;
    }
    const CellGrid::Cell c = bodies[body].grid.cell_of(place);
    int number = 0;
    for (std::int64_t z = c.z - rings; z <= c.z + rings; ++z) {
      for (std::int64_t y = c.y - rings; y <= c.y + rings; ++y) {
        for (std::int64_t x = c.x - rings; x <= c.x + rings; ++x) {
          if (number++ % threads == thread) visit_cell(body, {x, y, z}, visit);
        }
      }
    }
  }
  __device__ bool is_of(int body, std::uint32_t k) const {
    return index[k] >= bodies[body].begin && index[k] < bodies[body].end;
  }
};

/// Calls visit(j) for each index that each(offer) offers, in ascending order of global ids. The
/// host sums in the same order, so that both results are equal bit by bit.
/// @param global_id of each index; null if it is the index itself
template <class Each, class Visit>
__device__ void in_ascending_order(const Index* global_id, Each&& each, Visit&& visit) {
  constexpr int most = 64;  // indices sorted in one pass; more take several passes
  Index found[most], after = -1;
  const auto id_of = [&](Index j) { return global_id ? global_id[j] : j; };
  for (;;) {
    int count = 0;
    each([&](Index j) {
      const Index n = id_of(j);
      if (n <= after || (count == most && n > id_of(found[most - 1]))) return;
      int k = count < most ? count++ : most - 1;
      for (; k > 0 && id_of(found[k - 1]) > n; --k) found[k] = found[k - 1];
      found[k] = j;
    });
    for (int k = 0; k < count; ++k) visit(found[k]);
    if (count < most) return;
    after = id_of(found[most - 1]);
  }
}

/// Owner of a spatial hash in device memory.
class DeviceHash {
 public:
  struct Body {
    Index begin, end;
    double cell_size;  ///< Requested size [m]; a cell is at least a millionth of the body.
  };

  /// Builds the hash. @param position positions on the device [m]
  DeviceHash(const DeviceArray<Vec3d>& position, const std::vector<Body>& bodies) {
    fill(position, bodies);
  }
  /// Builds the hash of one body, and does not wait. @param box around the positions
  /// @param cell_size requested size [m]
  DeviceHash(const DeviceArray<Vec3d>& position, const Box& box, double cell_size) {
    fill(position, box, cell_size);
  }

  HashView view() const {
    return {bodies_.data(), static_cast<int>(bodies_.size()), mask_, start_.data(), entries_.data(),
            index_.data(),  static_cast<Index>(index_.size())};
  }
  /// Mean number of points in a non-empty cell; an underestimate if cells share a bucket.
  double mean_occupancy() const;

  void fill(const DeviceArray<Vec3d>& position, const std::vector<Body>& bodies);
  void fill(const DeviceArray<Vec3d>& position, const Box& box, double cell_size);
  /// Sorts the points into the cells of `bodies_`.
  void sort_into_cells(const DeviceArray<Vec3d>& position);

 private:
  void set_mask(std::size_t points);
  HashView::Body body_in(const Box& box, const Body& body) const;

  std::uint64_t mask_ = 0;
  DeviceArray<HashView::Body> bodies_;
  DeviceArray<std::uint32_t> start_;
  DeviceArray<HashView::Entry> entries_;
  DeviceArray<Index> index_;
};

/// The bounding box of points [begin, end).
Box box_around(const DeviceArray<Vec3d>& position, Index begin, Index end);

}  // namespace phyxel::cuda
