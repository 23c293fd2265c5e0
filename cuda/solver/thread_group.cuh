/// Groups of threads of a warp that share the work on a list of the passes of contact.
#pragma once

#include "phyxel/physics/body_contact.hpp"

namespace phyxel::cuda {

/// The group of the thread that makes it, as `OneThread` on the host. Sums are the same in all of
/// its threads, and do not depend on where in a grid it is.
class ThreadGroup {
 public:
  static constexpr int size = contact_threads;   ///< Threads of a group.
  static constexpr int block = 128;              ///< Threads of a block.
  static constexpr int in_block = block / size;  ///< Groups of a block.

  __device__ ThreadGroup()
      : thread_(static_cast<int>(threadIdx.x % size)),
        mask_(((1ull << size) - 1) << (threadIdx.x % 32 / size * size)) {}

  /// The number of the group in the grid.
  __device__ int number() const {
    return static_cast<int>(blockIdx.x * in_block + threadIdx.x / size);
  }
  template <class Each>
  __device__ void each(const Offset* start, Each&& each) const {
    for (Offset k = start[thread_]; k < start[thread_ + 1]; ++k) each(k);
  }
  __device__ int part() const { return thread_; }
  __device__ Offset first_of(const Offset* start) const { return start[thread_]; }
  __device__ Offset end_of(const Offset* start) const { return start[thread_ + 1]; }
  __device__ double sum(double part) const {
    for (int way = size / 2; way > 0; way /= 2) part += __shfl_xor_sync(mask_, part, way);
    return part;
  }
  __device__ Vec3<double> sum(const Vec3<double>& part) const {
    return {sum(part.x), sum(part.y), sum(part.z)};
  }
  __device__ Sym3<double> sum(const Sym3<double>& part) const {
    return {sum(part.xx), sum(part.xy), sum(part.xz), sum(part.yy), sum(part.yz), sum(part.zz)};
  }
  __device__ Mat3<double> sum(const Mat3<double>& part) const {
    Mat3<double> all;
    for (int k = 0; k < 9; ++k) all(k / 3, k % 3) = sum(part(k / 3, k % 3));
    return all;
  }
  __device__ NearestPhyxel nearest(NearestPhyxel own) const {
    int thread = thread_;
    for (int way = size / 2; way > 0; way /= 2) {
      const auto of_other = [&](auto value) { return __shfl_xor_sync(mask_, value, way); };
      const NearestPhyxel other{of_other(own.square),
                                {of_other(own.rest.x), of_other(own.rest.y), of_other(own.rest.z)}};
      const int its = of_other(thread);
      if (other.square > own.square || (other.square == own.square && its > thread)) continue;
      own = other;
      thread = its;
    }
    return own;
  }
  __device__ double least(double own) const {
    for (int way = size / 2; way > 0; way /= 2) {
      own = fmin(own, __shfl_xor_sync(mask_, own, way));
    }
    return own;
  }
  __device__ bool is_first() const { return thread_ == 0; }

 private:
  int thread_;
  unsigned mask_;
};

}  // namespace phyxel::cuda
