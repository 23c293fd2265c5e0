/// The spatial hash on the device. Points stand in their buckets by index, so that a visit meets
/// them in one order; bodies share the table, each with cells of its own size.
#pragma once

#include "model/cell_grid.hpp"
#include "setup/primitives.cuh"

namespace phyxel::cuda {

/// What kernels see of it.
struct HashView {
  struct alignas(16) Entry {
    Vec3d position;
    std::uint64_t cell;
  };
  struct Body {
    CellGrid grid;
    double cell_size;
    Vec3d high;
    Index begin, end;  ///< Its points.
  };

  const Body* bodies;
  int body_count;
  std::uint64_t mask;
  const std::uint32_t* bucket_start;
  const Entry* entries;
  const Index* index;  ///< Of each entry.
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

  /// Calls visit(k, position) for every entry k of the body in a cell; where another body's cell
  /// has the same name and bucket, for its entries too.
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
  /// Calls visit(k, position) once for every entry k nearer to `place` than `reach`, and others.
  template <class Visit>
  __device__ void visit_near(int body, Vec3d place, double reach, Visit&& visit) const {
    const int rings = rings_within(reach, bodies[body].cell_size);
    const double width = 2.0 * rings + 1;
    if (rings > 3 && width * width * width > points) {  // more cells than points
      visit_all(body, visit);
      return;
    }
    const CellGrid::Cell c = bodies[body].grid.cell_of(place);
    for (std::int64_t z = c.z - rings; z <= c.z + rings; ++z) {
      for (std::int64_t y = c.y - rings; y <= c.y + rings; ++y) {
        for (std::int64_t x = c.x - rings; x <= c.x + rings; ++x) {
          visit_cell(body, {x, y, z}, visit);
        }
      }
    }
  }
  __device__ bool is_of(int body, std::uint32_t k) const {
    return index[k] >= bodies[body].begin && index[k] < bodies[body].end;
  }
};

/// Calls visit(j) with every index that each(offer) offers, by ascending number: the order in which
/// the host sums, so that both get the same bits.
/// @param number of each index in the whole model; null: the index itself
template <class Each, class Visit>
__device__ void in_ascending_order(const Index* number, Each&& each, Visit&& visit) {
  constexpr int most = 64;  // at once; where there are more, they are sought again
  Index found[most], after = -1;
  const auto number_of = [&](Index j) { return number ? number[j] : j; };
  for (;;) {
    int count = 0;
    each([&](Index j) {
      const Index n = number_of(j);
      if (n <= after || (count == most && n > number_of(found[most - 1]))) return;
      int k = count < most ? count++ : most - 1;
      for (; k > 0 && number_of(found[k - 1]) > n; --k) found[k] = found[k - 1];
      found[k] = j;
    });
    for (int k = 0; k < count; ++k) visit(found[k]);
    if (count < most) return;
    after = number_of(found[most - 1]);
  }
}

class DeviceHash {
 public:
  struct Body {
    Index begin, end;
    double cell_size;  ///< Wanted; a cell may not be smaller than a millionth of the body.
  };

  /// @param position on the device
  DeviceHash(const DeviceArray<Vec3d>& position, const std::vector<Body>& bodies) {
    fill(position, bodies);
  }

  HashView view() const {
    return {bodies_.data(), static_cast<int>(bodies_.size()), mask_, start_.data(), entries_.data(),
            index_.data(),  static_cast<Index>(index_.size())};
  }
  /// Mean number of points in a cell that holds any, or a little less.
  double mean_occupancy() const;

  void fill(const DeviceArray<Vec3d>& position, const std::vector<Body>& bodies);

 private:
  std::uint64_t mask_ = 0;
  DeviceArray<HashView::Body> bodies_;
  DeviceArray<std::uint32_t> start_;
  DeviceArray<HashView::Entry> entries_;
  DeviceArray<Index> index_;
};

/// The box around points [begin, end).
Box box_around(const DeviceArray<Vec3d>& position, Index begin, Index end);

}  // namespace phyxel::cuda
