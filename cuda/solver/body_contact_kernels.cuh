/// The kernels by which bodies are kept out of each other on the GPU.
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#include "solver/contact_passes.hpp"
#include "solver/contacts.cuh"
#include "solver/device_model.cuh"
#include "solver/device_sums.cuh"
#include "solver/thread_group.cuh"

namespace phyxel::cuda {

/// The phyxels of this device that may touch other bodies, in device memory, shape [count] each;
/// they are the first of the points of `ContactPasses`.
template <class Real>
struct SurfacePlaces {
  const Index* place = nullptr;            ///< Tile slots.
  const Vec3<double>* position = nullptr;  ///< At rest [m].
  const SurfaceSite* site = nullptr;
  const Vec3<double>* centre = nullptr;  ///< Centre of mass of their bodies, at rest [m].
  const Index* body = nullptr;           ///< Numbers of their bodies.
  const Index* entry = nullptr;          ///< Where their gradients are.
  const Real* gradients = nullptr;       ///< Of displacement, shape [9, stride].
  std::size_t stride = 0;
  SurfaceMotion* motion = nullptr;
  Vec3<double>* velocity = nullptr;  ///< Over the step, so far [m/s].
  PointForces* forces = nullptr;     ///< Of all sweeps of the step.
  int count = 0;
};

/// Copies the places of phyxels of the layer [m]. One thread per phyxel.
template <class Real, class StateReal>
__global__ void copy_places(Fields<Real, StateReal> f, const Index* place,
                            const Vec3<double>* position, Vec3<double>* now, int count) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k < count) now[k] = position[k] + displacement_at(f, place[k]);
}

/// The number of numbers in a box of ways and a box of velocities.
inline constexpr std::size_t numbers_of_way = 12;

/// Finds the boxes of the ways of the phyxels of each group of the layer since points were found,
/// and of their velocities: the lowest numbers of both [m, m/s], then the highest ones. One block
/// of `tile_size` threads per group.
template <class Real, class StateReal>
__global__ void find_ways(Fields<Real, StateReal> f, const Index* place,
                          const Vec3<double>* position, const Vec3<double>* found,
                          const Index* begin, const Index* end, double* ways) {
  constexpr int numbers = numbers_of_way / 2;
  double low[numbers], high[numbers];
  for (int n = 0; n < numbers; ++n) {
    low[n] = HUGE_VAL;
    high[n] = -HUGE_VAL;
  }
  for (Index k = begin[blockIdx.x] + static_cast<Index>(threadIdx.x); k < end[blockIdx.x];
       k += static_cast<Index>(blockDim.x)) {
    const Vec3<double> way = position[k] + displacement_at(f, place[k]) - found[k];
    const Vec3<double> speed = to<double>(column3(f.velocity, f.places, place[k]));
    const double all[] = {way.x, way.y, way.z, speed.x, speed.y, speed.z};
    for (int n = 0; n < numbers; ++n) {
      low[n] = fmin(low[n], all[n]);
      high[n] = fmax(high[n], all[n]);
    }
  }
  __shared__ double of_warp[2 * numbers][tile_size / 32];
  const unsigned warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  for (int n = 0; n < numbers; ++n) {
    for (int lanes = 16; lanes > 0; lanes /= 2) {
      low[n] = fmin(low[n], __shfl_down_sync(0xffffffff, low[n], lanes));
      high[n] = fmax(high[n], __shfl_down_sync(0xffffffff, high[n], lanes));
    }
    if (lane != 0) continue;
    of_warp[n][warp] = low[n];
    of_warp[numbers + n][warp] = high[n];
  }
  __syncthreads();
  if (threadIdx.x >= 2 * numbers) return;
  double most = of_warp[threadIdx.x][0];
  for (int w = 1; w < tile_size / 32; ++w) {
    const double other = of_warp[threadIdx.x][w];
    most = threadIdx.x < numbers ? fmin(most, other) : fmax(most, other);
  }
  ways[2 * numbers * blockIdx.x + threadIdx.x] = most;
}

/// Raises a number to a positive value if it is smaller. Both are positive or zero: such doubles
/// are in the order of their bits.
static __device__ void raise_to(double* number, double value) {
  atomicMax(reinterpret_cast<unsigned long long*>(number),
            static_cast<unsigned long long>(__double_as_longlong(value)));
}

/// Adds the way of points in the last step to the way before it.
static __device__ void add_way(PointWay& way) {
  way.before += way.in_step;
  way.in_step = 0;
}
/// The same, by the first thread.
static __global__ void end_way(PointWay* way) {
  if (blockIdx.x == 0 && threadIdx.x == 0) add_way(*way);
}

/// Sets what is known of points at the start of a step. One thread per point.
template <class Real, class StateReal>
__global__ void begin_motion(Fields<Real, StateReal> f, SurfacePlaces<Real> s, PointWay* way) {
  const int p = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (p == 0) add_way(*way);
  if (p >= s.count) return;
  SurfaceMotion& motion = s.motion[p];
  motion.before = s.position[p] + displacement_at(f, s.place[p]);
  motion.earlier = to<double>(column3(f.velocity, f.places, s.place[p]));
  Mat3<double> gradient;
  for (int e = 0; e < 9; ++e) gradient(e / 3, e % 3) = s.gradients[e * s.stride + s.entry[p]];
  set_gradient(motion, s.site[p], gradient);
  s.forces[p] = {};
}

/// Sets where points are at the end of a step, before contact, and the largest of their ways there.
/// One thread per point.
template <class Real, class StateReal>
__global__ void end_motion(Fields<Real, StateReal> f, SurfacePlaces<Real> s, PointWay* way) {
  const int p = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  double length = 0;
  if (p < s.count) {
    const Vec3<double> after = s.position[p] + displacement_at(f, s.place[p]);
    const Vec3<double> gone = after - s.motion[p].after;
    length = std::sqrt(dot(gone, gone));
    s.motion[p].after = after;
    s.velocity[p] = to<double>(column3(f.velocity, f.places, s.place[p]));
  }
  for (int lanes = 16; lanes > 0; lanes /= 2) {
    length = fmax(length, __shfl_down_sync(0xffffffff, length, lanes));
  }
  if (threadIdx.x % 32 == 0 && length > 0) raise_to(&way->in_step, length);
}

/// A list to which kernels add the numbers of rows or points, in any order: the work on one row or
/// point depends on no other.
struct NumberList {
  Index* number;
  int* count;

  __device__ void add(Index value) const { number[atomicAdd(count, 1)] = value; }
  /// Calls each(threads, number) for all numbers, by groups of threads of any grid.
  template <class Each>
  __device__ void for_each(Each&& each) const {
    const ThreadGroup threads;
    const int all = *count, groups = static_cast<int>(gridDim.x) * ThreadGroup::in_block;
    for (int k = threads.number(); k < all; k += groups) each(threads, number[k]);
  }
};

/// The rows and points on which a step has more work to do.
struct ContactLists {
  NumberList near;       ///< Rows whose bodies are near their points.
  NumberList inside;     ///< Rows whose points are inside.
  NumberList active;     ///< Points on which forces act, those of other devices included.
  std::uint64_t* range;  ///< Entries within range (`WithinRange`), shape [rows, contact_threads].

  __device__ std::uint64_t& range_of(const ThreadGroup& threads, Index r) const {
    return range[contact_threads * static_cast<Offset>(r) + threads.part()];
  }
  /// The entries of a near row that lie within range.
  __device__ WithinRange<ThreadGroup> in_range(const ThreadGroup& threads,
                                               const ContactPasses& passes, Index r) const {
    return {threads, passes.entries_of_row(r), range_of(threads, r)};
  }
};

/// Empties the lists of a step: forces act on no point yet. One thread per point.
/// @param is_active as of `ContactPasses`, shape [points]
static __global__ void empty_lists(ContactLists lists, char* is_active, int points) {
  const int p = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (p == 0) *lists.near.count = *lists.inside.count = *lists.active.count = 0;
  if (p < points) is_active[p] = 0;
}

/// Lists the rows whose bodies are near their points. One group of threads per row.
static __global__ void find_near_rows(ContactPasses passes, ContactLists lists, int rows) {
  const ThreadGroup threads;
  const Index r = threads.number();
  if (r >= rows || passes.is_asleep(r)) return;
  const WithinRange in_range(threads, passes.motion[passes.row[r].point], passes.entries_of_row(r),
                             passes.motions());
  if (!passes.comes_near(threads, in_range, r)) return;
  lists.range_of(threads, r) = in_range.bits();
  if (threads.is_first()) lists.near.add(r);
}
// Groups of threads for the numbers of lists.
static __global__ void find_patches(ContactPasses passes, ContactLists lists) {
  lists.near.for_each([&](const ThreadGroup& threads, Index r) {
    passes.find_patch(lists.in_range(threads, passes, r), r);
  });
}
/// Finds the touches of near rows. Four blocks share a multiprocessor: they hide more latency than
/// their spilled registers cost.
static __global__ void __launch_bounds__(ThreadGroup::block, 4)
    find_touches(ContactPasses passes, ContactLists lists) {
  lists.near.for_each([&](const ThreadGroup& threads, Index r) {
    const bool inside = passes.find_touch_within(threads, lists.in_range(threads, passes, r), r);
    if (inside && threads.is_first()) lists.inside.add(r);
  });
}
static __global__ void find_carrying(ContactPasses passes, ContactLists lists) {
  lists.inside.for_each([&](const ThreadGroup& threads, Index r) {
    passes.find_carrying(threads, lists.in_range(threads, passes, r), r);
  });
}
/// Lists the points on which forces act. One thread per point.
static __global__ void list_active(const char* is_active, int points, NumberList active) {
  const int p = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (p < points && is_active[p]) active.add(p);
}
static __global__ void find_carriers(ContactPasses passes, NumberList active) {
  active.for_each([&](const ThreadGroup& threads, Index p) { passes.find_carriers(threads, p); });
}
static __global__ void find_shares(ContactPasses passes, NumberList active) {
  active.for_each([&](const ThreadGroup& threads, Index p) { passes.find_share(threads, p); });
}
static __global__ void find_responses(ContactPasses passes, NumberList inside) {
  inside.for_each([&](const ThreadGroup& threads, Index r) { passes.find_response(threads, r); });
}
static __global__ void find_row_forces(ContactPasses passes, NumberList inside) {
  inside.for_each([&](const ThreadGroup& threads, Index r) { passes.find_force(threads, r); });
}
static __global__ void find_row_pushes(PenaltyPasses passes, NumberList inside) {
  inside.for_each([&](const ThreadGroup& threads, Index r) { passes.find_push(threads, r); });
}
static __global__ void find_row_rubs(PenaltyPasses passes, NumberList inside) {
  inside.for_each([&](const ThreadGroup& threads, Index r) { passes.find_rub(threads, r); });
}

/// Finds the depth of the deepest phyxel of each body in other bodies [m], of this device's points,
/// then the largest depth of each over the smaller range of both bodies. One thread per row.
/// @param body of each point. @param ranges of the bodies [m], shape [bodies]
/// @param deepest zero at first, shape [2, bodies]
static __global__ void find_depths(ContactPasses passes, const Index* body, const double* ranges,
                                   int bodies, int points, int rows, double* deepest) {
  const int r = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (r >= rows || !passes.touch[r].is_inside || passes.row[r].point >= points) return;
  const double depth = -passes.touch[r].gap;
  if (!(depth > 0)) return;
  const Index own = body[passes.row[r].point];
  raise_to(deepest + own, depth);
  raise_to(deepest + bodies + own, depth / fmin(ranges[own], ranges[passes.row[r].body]));
}

/// Changes the velocity of a point by penalties as a step starts.
/// @param regain 1 over what damping keeps of a velocity, shape [count]
template <class Real, class StateReal>
__device__ void push_point(const Fields<Real, StateReal>& f, const ContactPasses& passes,
                           const SurfacePlaces<Real>& s, const double* regain,
                           const ThreadGroup& threads, Index p) {
  const Vec3<double> push = passes.forces_on(threads, p).normal;
  if (!threads.is_first()) return;
  s.forces[p].normal += push;
  const Vec3<double> change = regain[p] * passes.change_by({push, {}}, p);
  if (change == Vec3<double>{}) return;
  const Index at = s.place[p];
  set_column3(f.velocity, f.places, at,
              to<StateReal>(to<double>(column3(f.velocity, f.places, at)) + change));
}

/// Moves a point by friction at the end of a step.
template <class Real, class StateReal>
__device__ void rub_point(const Fields<Real, StateReal>& f, const ContactPasses& passes,
                          const SurfacePlaces<Real>& s, const ThreadGroup& threads, Index p) {
  const Vec3<double> friction = passes.forces_on(threads, p).tangential;
  if (!threads.is_first()) return;
  s.forces[p].tangential += friction;
  const Vec3<double> change = passes.change_by({{}, friction}, p);
  if (change == Vec3<double>{}) return;
  const Index at = s.place[p];
  move_to(f, at, displacement_at(f, at) + passes.dt * change,
          to<double>(column3(f.velocity, f.places, at)) + change);
  s.velocity[p] = to<double>(column3(f.velocity, f.places, at));
}

/// Moves a point by the forces on it.
template <class Real, class StateReal>
__device__ void move_point(const Fields<Real, StateReal>& f, const ContactPasses& passes,
                           const SurfacePlaces<Real>& s, const ThreadGroup& threads, Index p) {
  const PointForces forces = passes.forces_on(threads, p);
  if (!threads.is_first()) return;
  PointForces& all = s.forces[p];
  all.normal += forces.normal;
  all.tangential += forces.tangential;
  const Vec3<double> change = passes.change_by(forces, p);
  if (change == Vec3<double>{}) return;
  const Index at = s.place[p];
  const Vec3<StateReal> v = to<StateReal>(to<double>(column3(f.velocity, f.places, at)) + change);
  set_column3(f.velocity, f.places, at, v);
  const Vec3<StateReal> u = to<StateReal>(displacement_at(f, at) + passes.dt * change);
  if constexpr (!std::is_same_v<Real, StateReal>) set_column3(f.displacement, f.places, at, u);
  auto record = f.points.get(at);
  record.u = to<Real>(u);
  f.points.set(at, record);
  s.velocity[p] = to<double>(v);
}

// Groups of threads for the active points of this device.
template <class Real, class StateReal>
__global__ void push_apart(Fields<Real, StateReal> f, ContactPasses passes, SurfacePlaces<Real> s,
                           const double* regain, NumberList active) {
  active.for_each([&](const ThreadGroup& threads, Index p) {
    if (p < s.count) push_point(f, passes, s, regain, threads, p);
  });
}
template <class Real, class StateReal>
__global__ void rub_apart(Fields<Real, StateReal> f, ContactPasses passes, SurfacePlaces<Real> s,
                          NumberList active) {
  active.for_each([&](const ThreadGroup& threads, Index p) {
    if (p < s.count) rub_point(f, passes, s, threads, p);
  });
}
template <class Real, class StateReal>
__global__ void move_apart(Fields<Real, StateReal> f, ContactPasses passes, SurfacePlaces<Real> s,
                           NumberList active) {
  active.for_each([&](const ThreadGroup& threads, Index p) {
    if (p < s.count) move_point(f, passes, s, threads, p);
  });
}

/// Adds what the forces of all sweeps do to the sums of the bodies. One thread per point.
template <class Real>
__global__ void add_contact_terms(SurfacePlaces<Real> s, double dt, SumWords sums) {
  const int p = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  ContactTerms terms;
  int first = 0;
  PointForces all;
  if (p < s.count) all = s.forces[p];
  if (__all_sync(0xffffffff, all.normal == Vec3<double>{} && all.tangential == Vec3<double>{})) {
    return;
  }
  if (p < s.count) {
    const SurfaceMotion& motion = s.motion[p];
    const Vec3<double> mean = 0.5 * (motion.earlier + s.velocity[p]);
    terms.set(dt * all.normal, dt * all.tangential, motion.before - s.centre[p], mean, mean);
    first = s.body[p] * ContactTerms::count;
  }
  for (int t = 0; t < ContactTerms::count; ++t) sums.add_of_warp(first + t, p, terms.value[t]);
}

}  // namespace phyxel::cuda
