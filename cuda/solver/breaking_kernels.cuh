/// The kernels of pairs that break (breaking.hpp).
#pragma once

#include "phyxel/physics/pair_motion.hpp"
#include "solver/breaking.hpp"
#include "solver/device_sums.cuh"
#include "solver/kernels.cuh"

namespace phyxel::cuda {

/// Arrays by which tiles are watched whose pairs may break.
template <class Real>
struct WatchView {
  const Index* phyxel_at = nullptr;   ///< [places]
  const Real* before = nullptr;       ///< Displacements at the start of the step, [3, places].
  Real* now = nullptr;                ///< Those at its end are written here, likewise.
  MotionBox<Real>* boxes = nullptr;   ///< Of each tile, of ghosts, too.
  Vec3<double>* omega = nullptr;      ///< By how much each body turns in a step.
  const Index* neighbours = nullptr;  ///< Tiles that the pairs of a tile reach, itself included.
  const Index* first_neighbour = nullptr;  ///< First of them of each tile, [tiles + 1].
  TileWatch* watch = nullptr;              ///< Of each tile that this rank steps.
  Index tiles = 0;                         ///< The number of these.
};

/// A functor that returns position and displacement of a tile slot.
template <class Real, class StateReal>
struct PointAt {
  const Fields<Real, StateReal>& fields;
  __device__ auto operator()(Index place) const {
    return fields.points.get(static_cast<std::size_t>(place));
  }
};

/// Joins the boxes of the first `lanes` threads of a warp, or of each group of so many, in each of
/// them. Called by a whole warp.
template <class Real>
__device__ void join_lanes(MotionBox<Real>& box, int lanes) {
  for (int half = lanes / 2; half > 0; half /= 2) {
    MotionBox<Real> other;
    for (int k = 0; k < MotionBox<Real>::numbers; ++k) {
      other.most[k] = __shfl_xor_sync(0xFFFF'FFFF, box.most[k], half);
    }
    box.add(other);
  }
}

/// Copies the present displacements of all tile slots. One thread per tile slot.
template <class Real, class StateReal>
__global__ void remember_motion(Fields<Real, StateReal> f, Real* displacement) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  set_column3(displacement, f.places, place, f.points.get(place).u);
}

/// Finds the box of the motions of each tile in the last step, and copies displacements. One block
/// per tile.
template <class Real, class StateReal>
__global__ void __launch_bounds__(tile_size)
    measure_motion(const __grid_constant__ Fields<Real, StateReal> f,
                   const __grid_constant__ BreakingView<Real> v,
                   const __grid_constant__ WatchView<Real> w) {
  constexpr int warps = tile_size / warp_size, numbers = MotionBox<Real>::numbers;
  __shared__ Real most[warps][numbers];
  const BreakingPart& part = v.parts[v.part_of_tile[blockIdx.x]];
  if (!part.breaks) return;
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  MotionBox<Real> box;
  if (w.phyxel_at[place] >= 0) {
    const auto point = f.points.get(place);
    box.add(point.x, column3(w.before, f.places, place), point.u, to<Real>(w.omega[part.body]));
    set_column3(w.now, f.places, place, point.u);
  }
  join_lanes(box, warp_size);
  if (threadIdx.x % warp_size == 0) {
    for (int k = 0; k < numbers; ++k) most[threadIdx.x / warp_size][k] = box.most[k];
  }
  __syncthreads();
  if (threadIdx.x >= warp_size) return;
  for (int k = 0; k < numbers; ++k) box.most[k] = most[threadIdx.x % warps][k];
  join_lanes(box, warps);
  if (threadIdx.x == 0) w.boxes[blockIdx.x] = box;
}

/// Finds by how much each body has turned in the last step, from some of its phyxels. One block of
/// `tile_size` threads per body.
/// @param samples places of these phyxels. @param first first of each body, [bodies + 1]
template <class Real, class StateReal>
__global__ void find_turning(Fields<Real, StateReal> f, WatchView<Real> w, const Index* samples,
                             const Index* first) {
  __shared__ double memory[tile_size * sizeof(TurningSums) / sizeof(double)];
  auto* const sums = reinterpret_cast<TurningSums*>(memory);
  TurningSums own;
  for (Index k = first[blockIdx.x] + static_cast<Index>(threadIdx.x); k < first[blockIdx.x + 1];
       k += tile_size) {
    const auto place = static_cast<std::size_t>(samples[k]);
    const auto point = f.points.get(place);
    const auto u = to<double>(point.u), old = to<double>(column3(w.before, f.places, place));
    own.add(to<double>(point.x) + 0.5 * (old + u), u - old);
  }
  sums[threadIdx.x] = own;
  for (int half = tile_size / 2; half > 0; half /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < half) sums[threadIdx.x].add(sums[threadIdx.x + half]);
  }
  if (threadIdx.x == 0) w.omega[blockIdx.x] = sums[0].turning();
}

/// True if the pairs of a tile are to be looked at. Called by a whole warp.
template <class Real>
__device__ bool is_due(const WatchView<Real>& w, Index tile) {
  MotionBox<Real> around;
  const int lane = static_cast<int>(threadIdx.x % warp_size);
  for (Index k = w.first_neighbour[tile] + lane; k < w.first_neighbour[tile + 1]; k += warp_size) {
    around.add(w.boxes[w.neighbours[k]]);
  }
  join_lanes(around, warp_size);
  const TileWatch before = w.watch[tile];
  const double apart = before.apart + around.diagonal();
  __syncwarp();
  if (lane == 0) w.watch[tile].apart = apart;
  return !(apart < before.next_look);
}

/// Looks at the tiles that are due, and breaks their pairs that are stretched too far. Each warp
/// finds whether a tile is due; then all warps of a block look at the block's tiles that are.
/// @param in_step as of `break_from`. @param taken one sum of energies [J]
template <class Real, class StateReal>
__global__ void __launch_bounds__(tile_size, 2)
    look_at_tiles(const __grid_constant__ Fields<Real, StateReal> f,
                  const __grid_constant__ BreakingView<Real> v,
                  const __grid_constant__ WatchView<Real> w, bool in_step, SumWords taken) {
  constexpr int warps = tile_size / warp_size;
  __shared__ char due[warps];
  __shared__ Real least[warps];
  const int warp = static_cast<int>(threadIdx.x) / warp_size;
  const PointAt<Real, StateReal> point_at{f};
  for (Index first = static_cast<Index>(blockIdx.x) * warps; first < w.tiles;
       first += static_cast<Index>(gridDim.x) * warps) {
    const Index own = first + warp;
    const bool watched = own < w.tiles && v.parts[v.part_of_tile[own]].breaks;
    const bool is_own_due = watched && is_due(w, own);
    if (threadIdx.x % warp_size == 0) due[warp] = is_own_due;
    __syncthreads();
    for (int k = 0; k < warps; ++k) {
      if (!due[k]) continue;
      const Index tile = first + k, place = tile * tile_size + static_cast<Index>(threadIdx.x);
      Look<Real> look;
      look.squared_slack = std::numeric_limits<Real>::max();
      if (w.phyxel_at[place] >= 0) look = look_at(v, point_at, place);
      Real slack = look.squared_slack;
      for (int half = warp_size / 2; half > 0; half /= 2) {
        const Real other = __shfl_xor_sync(0xFFFF'FFFF, slack, half);
        slack = other < slack ? other : slack;
      }
      if (threadIdx.x % warp_size == 0) least[warp] = slack;
      if (look.breaks) {
        break_from(v, point_at, in_step, place,
                   [&](double energy) { taken.add(0, place, energy); });
      }
      __syncthreads();
      if (threadIdx.x == 0) {
        for (int other = 1; other < warps; ++other) {
          slack = least[other] < slack ? least[other] : slack;
        }
        w.watch[tile].next_look = w.watch[tile].apart + slack_of(slack);
      }
      __syncthreads();
    }
    __syncthreads();
  }
}

/// Makes tiles be looked at in the next step. One thread per tile.
static __global__ void begin_watch(TileWatch* watch, Index tiles) {
  const auto tile = static_cast<Index>(blockIdx.x * blockDim.x + threadIdx.x);
  if (tile < tiles) watch[tile] = {};
}

/// Calls work(place) for the phyxels that have lost pairs, a warp for each tile.
template <class Real, class Work>
__device__ void for_each_torn(const BreakingView<Real>& v, Index tiles, Work&& work) {
  const auto tile = static_cast<Index>((blockIdx.x * blockDim.x + threadIdx.x) / warp_size);
  if (tile >= tiles || !v.lost_in_tile[tile]) return;
  for (int k = static_cast<int>(threadIdx.x % warp_size); k < tile_size; k += warp_size) {
    const Index place = tile * tile_size + k;
    if (v.lost[place] > 0) work(place);
  }
}

/// Finds the forces of closed cracks. A warp per tile.
template <class Real, class StateReal>
__global__ void find_closed(const __grid_constant__ Fields<Real, StateReal> f,
                            const __grid_constant__ BreakingView<Real> v, Index tiles,
                            double* force) {
  const PointAt<Real, StateReal> point_at{f};
  for_each_torn(v, tiles, [&](Index place) {
    set_column3(force, f.places, static_cast<std::size_t>(place), closed_force(v, point_at, place));
  });
}
/// Adds them to those of hourglass control, which the first pass has found. A warp per tile.
template <class Real, class StateReal>
__global__ void add_closed(const __grid_constant__ Fields<Real, StateReal> f,
                           const __grid_constant__ BreakingView<Real> v, Index tiles,
                           const double* force) {
  for_each_torn(v, tiles, [&](Index place) {
    const auto at = static_cast<std::size_t>(place);
    Vec3<double> all = column3(force, f.places, at);
    if (v.part(place).pulls) all = to<double>(column3(f.pull, f.places, at)) + all;
    set_column3(f.pull, f.places, at, to<Real>(all));
  });
}

/// A pair that a state has broken, from one of its phyxels.
struct CutPair {
  Index place, neighbour;
};
/// Overwrites the entries of some pairs. One thread per pair.
template <class Real>
__global__ void cut_pairs(BreakingView<Real> v, const CutPair* pairs, int count) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const CutPair pair = pairs[k];
  atomicAdd(v.lost + pair.place, v.first.cut(pair.place, pair.neighbour));
  if (v.second.rows) v.second.cut(pair.place, pair.neighbour);
}

/// What a state says of a phyxel that has lost pairs.
struct TornPhyxel {
  Index place;
  double carried;
};
/// Makes the constants of phyxels that a state has torn. One thread per phyxel.
template <class Real, class StateReal>
__global__ void remake_torn(const __grid_constant__ Fields<Real, StateReal> f,
                            const __grid_constant__ BreakingView<Real> v, const TornPhyxel* torn,
                            int count) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  v.carried[torn[k].place] = torn[k].carried;
  remake_constants(v, PointAt<Real, StateReal>{f}, torn[k].place);
}

/// Constants of a phyxel with all its pairs.
struct WholePhyxel {
  Index place;
  LeftMoments moments;
  Vec3<double> closing;
};
/// Gives phyxels all their pairs back but for the entries of lists. One thread per phyxel.
template <class Real>
__global__ void make_whole(BreakingView<Real> v, const WholePhyxel* whole, int count) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const Index place = whole[k].place;
  write_constants(v, place, whole[k].moments, 1);
  if (v.closing) v.set_column(v.closing, place, whole[k].closing);
  v.carried[place] = 1;
  v.lost[place] = 0;
  v.lost_in_tile[place / tile_size] = 0;
}

/// Writes the neighbours from which phyxels have broken. One thread per phyxel.
/// @param places of the phyxels. @param first first of its neighbours in `neighbours` of each
template <class Real>
__global__ void list_broken(BreakingView<Real> v, const Index* places, const Offset* first,
                            int count, Index* neighbours) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  Offset at = first[k];
  v.first.for_each_broken(places[k], [&](Index j) { neighbours[at++] = j; });
}

}  // namespace phyxel::cuda
