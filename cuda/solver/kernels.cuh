/// The two passes of a step over tiles, with one block per tile and one thread per phyxel.
///
/// A block copies the records of its tile and halo into shared memory, then every lane walks its
/// list there (see tiling.hpp for its order). Per phyxel and step, float, about 32 neighbours, one
/// list: pass 1 moves 24 bytes a point into shared memory (about three points a phyxel, two of them
/// from the second-level cache) and 64 of list, reads 28, writes 48; pass 2 moves 48 a point and 64
/// of list, reads 52 and writes 36. Loads from shared memory limit pass 2, and the issue of
/// instructions limits pass 1.
#pragma once

#include "phyxel/physics/point.hpp"
#include "phyxel/physics/weight.hpp"
#include "solver/fused_halo.cuh"
#include "solver/law_stress.cuh"
#include "solver/records.cuh"

namespace phyxel::cuda {

/// A tag in a list of pair terms: kernels of such a list have weights of pairs (`pair_weight`), for
/// which other kernels do not pay.
struct PairWeights : PairTerm {};
/// The list of bodies with weights of pairs. Their closing vectors are zero if their gradients are
/// not closed.
using WithPairWeights = PairTerms<ClosedGradients, HourglassControl, PairWeights>;

/// Constants of a tile's body, in the working precision.
template <class Real, class StateReal>
struct TileConstants {
  Real law[law_numbers];   ///< As in `ChosenLaw::constants`.
  Real hourglass;          ///< κ [N/m]; 0 without hourglass control.
  Real inverse_h_squared;  ///< [1/m²], if the body has one support; -1/H² with weights of pairs.
  StateReal keep, gain;    ///< Factors of `damped_flow`; gain is the step without damping.
  bool damped;             ///< For kernels that serve damped and undamped bodies.
  int law_index;           ///< Index in `Laws`, for kernels that serve bodies of any law.

  /// True with weights of pairs (`pair_weight`). The sign tells, so that constants of other kernels
  /// stay where they are.
  __host__ __device__ bool pairwise() const { return inverse_h_squared < Real(0); }
};

/// `TileLists` in device memory.
struct DeviceLists {
  const Index* halo;
  int halo_stride, slots;
  const TileLists::Row* rows;
  const uint4* entries;
};

/// A model and its state as the kernels access them.
template <class Real, class StateReal>
struct Fields {
  Points<Real> points;
  Stresses<Real> stresses;
  /// 1/h² [1/m²], or `relative_half_support` in bodies with weights of pairs, [places]; null if
  /// each body has one support.
  const Real* inverse_h_squared;
  Real* moment_constants;  ///< A⁻¹ (xx, xy, xz, yy, yz, zz) and v, shape [7, places].
  Real* force_constants;   ///< b and 1/m, shape [4, places]; -1/m if fixed, 0 if empty.
  const Real* load;        ///< Applied forces, [3, places], or null.
  Real* pull;              ///< Force of hourglass control and closed cracks, [3, places], or null.
  Real* closing;           ///< ĉ of closed gradients [1/m]: [3, places], or null.
  ClosingStresses<Real> closing_stresses;
  StateReal* velocity;      ///< [3, places]
  StateReal* displacement;  ///< [3, places] if StateReal is not Real, else null.
  const TileConstants<Real, StateReal>* tiles;
  Vec3<StateReal> gravity;
  std::size_t places;
  const Real* external;    ///< The caller's part of `load`, [3, places], or null.
  const Real* following;   ///< Of loads that follow the surface, for energies, or null.
  Real* history;           ///< Histories, [history_numbers, places], or null.
  int history_numbers;     ///< Largest number of history values of a phyxel.
  HistoryUse history_use;  ///< How stresses treat the history,
  Real history_interval;   ///< and the time from the history to the displacements [s].
};

/// Returns the velocity after a step [m/s]. @param force all forces but gravity [N]
template <class Real, class StateReal, bool damped, class Constants>
__device__ Vec3<StateReal> next_velocity(Vec3<StateReal> velocity, Vec3<Real> force,
                                         Real inverse_mass, Vec3<StateReal> gravity, StateReal dt,
                                         const Constants& body) {
  const Vec3<StateReal> acceleration = to<StateReal>(inverse_mass * force) + gravity;
  if constexpr (damped) {
    return verlet_velocity_damped(velocity, acceleration, body.keep, body.gain);
  } else {
    return verlet_velocity(velocity, acceleration, dt);
  }
}

template <class T>
__device__ Vec3<T> column3(const T* array, std::size_t places, std::size_t place) {
  return {array[place], array[places + place], array[2 * places + place]};
}
template <class T>
__device__ void set_column3(T* array, std::size_t places, std::size_t place, Vec3<T> v) {
  array[place] = v.x;
  array[places + place] = v.y;
  array[2 * places + place] = v.z;
}

/// The tile slot of this thread's phyxel.
__device__ inline unsigned place_of(Index tile) {
  return static_cast<unsigned>(tile) * tile_size + threadIdx.x;
}
__device__ inline unsigned warp_place_of(Index tile) {
  return static_cast<unsigned>(tile) * tile_size + (threadIdx.x & ~(warp_size - 1U));
}

/// Prefetches a warp's part of `rows` rows of an array, `row_elements` apart, into the second-level
/// cache, so that it is there when the neighbour loop ends. `first` is the element that the warp's
/// first lane will read.
template <class T>
__device__ void prefetch_rows(const T* first, std::size_t row_elements, unsigned rows) {
  constexpr unsigned lines = warp_size * sizeof(T) / 128;
  const unsigned lane = threadIdx.x % warp_size;
  if (lane < rows * lines) {
    const T* line = first + lane / lines * row_elements + lane % lines * (128 / sizeof(T));
    asm volatile("prefetch.global.L2 [%0];" ::"l"(line));
  }
}

/// Starts the copies of a tile and its halo into the image, and fills the null slots.
template <class Records>
__device__ void fetch_tile(const Records& records, const DeviceLists& lists, Index tile,
                           char* image) {
  constexpr int batch = 3;  // indices loaded at once
  const int thread = static_cast<int>(threadIdx.x);
  const Index* halo = lists.halo + static_cast<std::size_t>(tile) * lists.halo_stride + thread;
  records.fetch(image, lists.slots, thread, static_cast<Index>(place_of(tile)));
#pragma unroll 1
  for (int begin = thread; begin < lists.halo_stride; begin += batch * tile_size) {
    Index place[batch];
#pragma unroll
    for (int k = 0; k < batch; ++k) {
      place[k] = begin + k * tile_size < lists.halo_stride ? __ldg(halo + k * tile_size) : -1;
    }
    halo += batch * tile_size;
#pragma unroll
    for (int k = 0; k < batch; ++k) {
      if (place[k] >= 0) {
        records.fetch(image, lists.slots, tile_size + far_slots + begin + k * tile_size, place[k]);
      }
    }
  }
  if (thread < far_slots) Records::set_far(image, lists.slots, tile_size + thread);
}

/// The start of this lane's list.
__device__ inline const uint4* list_of(const DeviceLists& lists, TileLists::Row row) {
  return lists.entries + static_cast<std::size_t>(row.chunk) * warp_size + threadIdx.x % warp_size;
}

/// Calls visit(offset) with each entry of this lane's list, in its order.
template <class Visit>
__device__ void walk(const DeviceLists& lists, TileLists::Row row, uint4 first, Visit&& visit) {
  const uint4* at = list_of(lists, row);
  const auto visit_both = [&](unsigned two) {
    visit(two & 0xFFFF);
    visit(two >> 16);
  };
  uint4 next = first;
  int left = row.length;
  for (; left >= chunk; left -= chunk) {
    const uint4 now = next;
    at += warp_size;
    if (left > chunk) next = __ldcs(at);
    visit_both(now.x);
    visit_both(now.y);
    visit_both(now.z);
    visit_both(now.w);
  }
  for (; left > 1; left -= 2) {
    visit_both(next.x);
    next.x = next.y;
    next.y = next.z;
    next.z = next.w;
  }
  if (left > 0) visit(next.x & 0xFFFF);
}

/// The first entries of this lane's list.
__device__ inline uint4 first_entries(const DeviceLists& lists, TileLists::Row row) {
  return row.length > 0 ? __ldcs(list_of(lists, row)) : uint4{0, 0, 0, 0};
}

/// Blocks of pass 1 per multiprocessor: more of them hide more latency, but leave a thread fewer
/// registers, of which some laws and terms need more than the 40 of six blocks in float.
template <class Real, class Law, class Terms>
constexpr int pass_1_blocks = sizeof(Real) == 4 ? (needs_many_registers<Law> || Terms::sends ? 4
                                                   : Terms::pulls                            ? 5
                                                                                             : 6)
                                                : (needs_many_registers<Law> ? 2 : 3);
template <class Real>
constexpr int pass_2_blocks = sizeof(Real) == 4 ? 5 : 2;
template <class Real>
constexpr int pass_2_blocks_sent = sizeof(Real) == 4 ? 4 : 2;

/// Copies the supports of a tile and its halo (`Fields::inverse_h_squared`) into shared memory, by
/// slot.
template <class Real, class StateReal>
__device__ __forceinline__ void fetch_supports(const Fields<Real, StateReal>& f,
                                               const DeviceLists& lists, Index tile,
                                               Real* supports) {
  supports[threadIdx.x] = f.inverse_h_squared[place_of(tile)];
  if (threadIdx.x < far_slots) supports[tile_size + threadIdx.x] = Real(1);
  const Index* halo = lists.halo + static_cast<std::size_t>(tile) * lists.halo_stride;
  for (int h = static_cast<int>(threadIdx.x); h < lists.halo_stride; h += tile_size) {
    if (halo[h] >= 0) supports[tile_size + far_slots + h] = f.inverse_h_squared[halo[h]];
  }
}

/// Calls use(weight_of) with the weights of pairs of this lane's phyxel: weight_of(x_ij, offset).
/// @param supports result of `fetch_supports`. @param body constants of the tile
template <class Real, class Constants, class Use>
__device__ __forceinline__ void with_pair_weights(const Real* supports, const Constants& body,
                                                  Use&& use) {
  const Real own = supports[threadIdx.x], inverse_length_squared = -body.inverse_h_squared;
  use([&](Vec3<Real> x, unsigned offset) {
    return pair_weight(dot(x, x), own, supports[offset / 16], inverse_length_squared);
  });
}

/// Output of the gradient-only variant of pass 1: entry e of thread t of block b is stored in
/// values[e * stride + b * tile_size + t].
template <class Real>
struct Gradients {
  Real* values;
  std::size_t stride;
  const Index* tile_of_block;  ///< Null for all tiles.
  Real* residuals = nullptr;   ///< Residuals of the fits (`add_residual`), or null.
};

/// Returns the residual of the fit of this lane's phyxel [m²] (`add_residual`). @param own its
/// point
/// @param fit its gradient. @param weight_of weights of its neighbours
template <class Real, class WeightOf>
__device__ __forceinline__ Real residual_of(const char* image, const DeviceLists& lists,
                                            TileLists::Row row,
                                            const typename Points<Real>::Value& own,
                                            const Mat3<Real>& fit, const WeightOf& weight_of) {
  Real residual{};
  walk(lists, row, first_entries(lists, row), [&](unsigned offset) {
    const auto p = Points<Real>::at(image, lists.slots, offset);
    const Vec3<Real> x = p.x - own.x;
    const Real w = weight_of(x, offset);
    // Null slots are skipped: the squares of their distances leave the range of float.
    if (w > Real(0)) add_residual(residual, p.u - own.u, fit, x, w);
  });
  return residual;
}

/// Pass 1: displacements -> gradient -> strain -> stress -> pair stress Q. With `only_gradient`,
/// only the gradients are written. @tparam Terms a list of pair terms
/// @tparam Law one of `Laws`, its sum with `VolumeConservation`, or `AnyViscousLaw`
template <class Real, class StateReal, class Law, class Terms, bool only_gradient,
          class Halo = NoHalo>
__global__ void __launch_bounds__(tile_size, (pass_1_blocks<Real, Law, Terms>))
    pass_1(const __grid_constant__ Fields<Real, StateReal> f,
           const __grid_constant__ DeviceLists lists, Index first_tile, Gradients<Real> gradients,
           const __grid_constant__ Halo exchange) {
  extern __shared__ __align__(16) char image[];
  Index tile = first_tile + static_cast<Index>(blockIdx.x);
  if constexpr (only_gradient) {
    if (gradients.tile_of_block) tile = gradients.tile_of_block[blockIdx.x];
  }
  const unsigned place = place_of(tile);
  const TileLists::Row row = lists.rows[place / warp_size];
  exchange.before(tile);
  fetch_tile(f.points, lists, tile, image);
  prefetch_rows(f.moment_constants + warp_place_of(tile), f.places, 7);
  const uint4 first = first_entries(lists, row);
  const TileConstants<Real, StateReal> body = f.tiles[tile];
  const Real inverse_h_squared =
      f.inverse_h_squared ? f.inverse_h_squared[place] : body.inverse_h_squared;
  Real* supports = reinterpret_cast<Real*>(image + Points<Real>::bytes * lists.slots);
  if constexpr (Terms::template has<PairWeights>) fetch_supports(f, lists, tile, supports);
  wait_for_copies();
  __syncthreads();

  const auto own = Points<Real>::at(image, lists.slots, 16 * threadIdx.x);
  // Calls use(weight_of). Only launches for gradients have tiles with and without weights of pairs;
  // a tile is of one body, so that its warps do not diverge.
  const auto weighted = [&](auto&& use) {
    if constexpr (Terms::template has<PairWeights>) {
      if (!only_gradient || body.pairwise()) return with_pair_weights(supports, body, use);
    }
    use([&](Vec3<Real> x, unsigned) {
      return weight_shape_anywhere(dot(x, x), inverse_h_squared);
    });
  };
  NeighbourSums<Real> sums;
  weighted([&](auto&& weight_of) {
    walk(lists, row, first, [&](unsigned offset) {
      const auto p = Points<Real>::at(image, lists.slots, offset);
      const Vec3<Real> x = p.x - own.x, u = p.u - own.u;
      const Real w = weight_of(x, offset);
      sums.template add<Terms::pulls>(x, u, w);
    });
  });

  const Real* c = f.moment_constants + place;
  PointConstants<Real> point;
  point.inverse_moment = {
      c[0], c[f.places], c[2 * f.places], c[3 * f.places], c[4 * f.places], c[5 * f.places]};
  const Mat3<Real> fit = displacement_gradient(sums.gradient, point.inverse_moment);
  if constexpr (Terms::sends) {
    point.moment_offset = column3(f.force_constants, f.places, place);
    point.closing = column3(f.closing, f.places, place);
  }
  const Mat3<Real> grad_u = Terms::gradient(fit, sums, point);
  if constexpr (only_gradient) {
    Real* to = gradients.values + place_of(static_cast<Index>(blockIdx.x));
    for (int e = 0; e < 9; ++e) to[e * gradients.stride] = grad_u(e / 3, e % 3);
    if (!gradients.residuals) return;
    weighted([&](auto&& weight_of) {
      gradients.residuals[place_of(static_cast<Index>(blockIdx.x))] =
          residual_of<Real>(image, lists, row, own, fit, weight_of);
    });
  } else {
    const HistoryColumns<Real> history{f.history, f.places, place};
    Mat3<Real> stress;
    if constexpr (std::is_same_v<Law, AnyViscousLaw>) {
      stress = stress_of_material<Law>(body, grad_u, history, f.history_use, f.history_interval);
    } else {
      stress = stress_of_law(make_law<Law, Real>(body.law), grad_u, history, f.history_use,
                             f.history_interval);
    }
    point.volume = c[6 * f.places];
    if constexpr (Terms::template has<HourglassControl>) point.hourglass = body.hourglass;
    const PointStress<Real> spread = Terms::stresses(stress, fit, sums, point);
    if constexpr (Terms::sends) f.closing_stresses.set(place, spread.closing_stress);
    if constexpr (Terms::template has<HourglassControl>) {
      if (!Terms::sends || f.pull) set_column3(f.pull, f.places, place, spread.hourglass_force);
    }
    f.stresses.set(place, {own.x, spread.pair_stress});
    exchange.after(tile);
  }
}

/// Pass 2: gathers Q into forces and takes one step. With `only_force`, only the internal forces
/// are written, to `force`, shape [3, places]. With `extra_forces`, loads and the forces of
/// hourglass control are added. @tparam Terms a list of pair terms
/// @tparam own_supports true if weights use `Fields::inverse_h_squared`; those of pairs do
template <class Real, class StateReal, bool own_supports, bool damped, bool extra_forces,
          bool only_force, class Halo = NoHalo, class Terms = NoPairTerms>
__global__ void __launch_bounds__(tile_size,
                                  Terms::sends ? pass_2_blocks_sent<Real> : pass_2_blocks<Real>)
    pass_2(const __grid_constant__ Fields<Real, StateReal> f,
           const __grid_constant__ DeviceLists lists, Index first_tile, StateReal dt, Real* force,
           const __grid_constant__ Halo exchange) {
  extern __shared__ __align__(16) char image[];
  const Index tile = first_tile + static_cast<Index>(blockIdx.x);
  const unsigned place = place_of(tile);
  const TileLists::Row row = lists.rows[place / warp_size];
  exchange.before(tile);
  fetch_tile(f.stresses, lists, tile, image);
  // The records are followed by what terms send, then by the support of each point.
  char* sent = image + Stresses<Real>::bytes * lists.slots;
  if constexpr (Terms::sends) fetch_tile(f.closing_stresses, lists, tile, sent);
  Real* supports = reinterpret_cast<Real*>(
      sent + (Terms::sends ? ClosingStresses<Real>::bytes : 0) * lists.slots);
  if constexpr (own_supports) fetch_supports(f, lists, tile, supports);
  prefetch_rows(f.force_constants + warp_place_of(tile), f.places, 4);
  if constexpr (!only_force) prefetch_rows(f.velocity + warp_place_of(tile), f.places, 3);
  const uint4 first = first_entries(lists, row);
  const TileConstants<Real, StateReal> body = f.tiles[tile];
  wait_for_copies();
  __syncthreads();

  const Vec3<Real> x_i = Stresses<Real>::at(image, lists.slots, 16 * threadIdx.x).x;
  // Calls use(weight_of), as in pass 1. Only launches for forces have tiles of both kinds.
  const auto weighted = [&](auto&& use) {
    if constexpr (Terms::template has<PairWeights>) {
      if (!only_force || body.pairwise()) return with_pair_weights(supports, body, use);
    }
    use([&](Vec3<Real> x, unsigned offset) {
      const Real inverse_h_squared = own_supports ? supports[offset / 16] : body.inverse_h_squared;
      return weight_shape_anywhere(dot(x, x), inverse_h_squared);
    });
  };
  Vec3<Real> sent_i;
  if constexpr (Terms::sends) {
    sent_i = ClosingStresses<Real>::at(sent, lists.slots, 16 * threadIdx.x);
  }
  Vec3<Real> sum;
  weighted([&](auto&& weight_of) {
    walk(lists, row, first, [&](unsigned offset) {
      const auto p = Stresses<Real>::at(image, lists.slots, offset);
      const Vec3<Real> x = p.x - x_i;
      const Real w = weight_of(x, offset);
      add_neighbour_force(sum, p.q, x, w);
      if constexpr (Terms::sends) {
        Terms::add_forces(sum, sent_i, ClosingStresses<Real>::at(sent, lists.slots, offset), w);
      }
    });
  });
  const Mat3<Real> q_i = Stresses<Real>::at(image, lists.slots, 16 * threadIdx.x).q;
  sum += own_force(q_i, column3(f.force_constants, f.places, place));
  if constexpr (only_force) {
    if (f.pull) sum += column3(f.pull, f.places, place);
    set_column3(force, f.places, place, sum);
    return;
  }

  const Real inverse_mass = f.force_constants[3 * f.places + place];
  if (inverse_mass > Real(0)) {
    if constexpr (extra_forces) {
      if (f.pull) sum += column3(f.pull, f.places, place);
      if (f.load) sum += column3(f.load, f.places, place);
    }
    const Vec3<StateReal> velocity = next_velocity<Real, StateReal, damped>(
        column3(f.velocity, f.places, place), sum, inverse_mass, f.gravity, dt, body);
    set_column3(f.velocity, f.places, place, velocity);
    auto point = f.points.get(place);
    if constexpr (std::is_same_v<Real, StateReal>) {
      point.u = fused(dt, velocity, point.u);
    } else {
      const Vec3<StateReal> u = fused(dt, velocity, column3(f.displacement, f.places, place));
      set_column3(f.displacement, f.places, place, u);
      point.u = to<Real>(u);
    }
    f.points.set(place, point);
  }
  exchange.after(tile);
}

}  // namespace phyxel::cuda
