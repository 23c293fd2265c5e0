/// Diagnostics on the GPU: energies, momenta and finiteness. Sums run in double over a tile in a
/// fixed tree, and over tiles without rounding, so that they depend neither on the order of tiles
/// nor on their distribution over ranks.
#pragma once

#include <cstdint>

#include "exact_sum.hpp"
#include "solver/kernels.cuh"
#include "solver/phyxel_totals.hpp"
#include "solver/totals.hpp"

namespace phyxel::cuda {

/// Constants of a tile's body for the sums.
struct TileMaterial {
  double law[law_numbers];  ///< As in `ChosenLaw::constants`.
  int law_index;            ///< Index in `Laws`.
  double volume_stiffness, hourglass;
  DampedFlow flow;      ///< From the time of the velocities to that of the displacements.
  Vec3<double> origin;  ///< Origin of positions [m].
};

/// Indices of the sums of a tile: `Sums`, then the number of inverted phyxels.
inline constexpr int inverted = Sums::count, sums = inverted + 1;

inline constexpr Index no_phyxel = INT32_MAX;

/// Sums and extremes of phyxels of one tile. Phyxels are identified by global ids.
struct TileTotals {
  double sum[sums];
  double largest_displacement, largest_speed;
  Index fastest, first_bad;  ///< `no_phyxel` if there is none; the smallest id on ties.
};

__device__ inline TileTotals combined(const TileTotals& a, const TileTotals& b) {
  TileTotals t;
  for (int k = 0; k < sums; ++k) t.sum[k] = a.sum[k] + b.sum[k];
  t.largest_displacement = fmax(a.largest_displacement, b.largest_displacement);
  t.largest_speed = fmax(a.largest_speed, b.largest_speed);
  t.fastest = min(a.largest_speed == t.largest_speed ? a.fastest : no_phyxel,
                  b.largest_speed == t.largest_speed ? b.fastest : no_phyxel);
  t.first_bad = min(a.first_bad, b.first_bad);
  return t;
}

/// Reduces the totals of a block in a fixed tree; thread 0 gets the result.
__device__ inline TileTotals of_block(TileTotals mine, TileTotals* shared) {
  shared[threadIdx.x] = mine;
  for (unsigned half = blockDim.x / 2; half > 0; half /= 2) {
    __syncthreads();
    if (threadIdx.x < half) {
      shared[threadIdx.x] = combined(shared[threadIdx.x], shared[threadIdx.x + half]);
    }
  }
  return shared[0];
}

/// Sums without rounding (`ExactSum`), and extremes as integers for atomic operations.
struct ExactTotals {
  unsigned long long word[sums][ExactSum::words];
  unsigned long long displacement_bits, speed_bits;  ///< Bits of non-negative doubles.
  Index fastest, first_bad;
};

__device__ inline void add_exactly(unsigned long long* words, double value) {
  ExactSum::split(value, [&](int word, std::int64_t number) {
    if (number != 0) atomicAdd(words + word, static_cast<unsigned long long>(number));
  });
}

inline constexpr int diagnose_threads = 128;

/// Sums the totals of each tile. @param force,gradient forces and gradients at the present
/// displacements; with hourglass control, row 9 of `gradient` has the residuals
/// @param history_interval time from the histories to the displacements [s]
/// @param moved prescribed axes of each phyxel (`Axes::bits`), or null
/// @param number_at global id of the phyxel in each tile slot
template <class Real, class StateReal>
__global__ void diagnose_tiles(const __grid_constant__ Fields<Real, StateReal> f,
                               const TileMaterial* materials, double history_interval,
                               const char* moved, const Real* force, const Real* gradient,
                               const Index* number_at, TileTotals* totals) {
  __shared__ TileTotals shared[diagnose_threads];
  TileTotals both{};
  for (int part = 0; part < tile_size / diagnose_threads; ++part) {
    const std::size_t place =
        static_cast<std::size_t>(blockIdx.x) * tile_size + part * diagnose_threads + threadIdx.x;
    const Real inverse_mass = f.force_constants[3 * f.places + place];
    TileTotals t{};
    t.fastest = t.first_bad = no_phyxel;
    if (inverse_mass != Real(0)) {  // the slot has a phyxel
      const TileMaterial m = materials[blockIdx.x];
      const auto column = [&](const auto* array) {
        return array ? to<double>(column3(array, f.places, place)) : Vec3<double>{};
      };
      const auto point = f.points.get(place);
      PhyxelState p{};
      p.mass = 1 / fabs(static_cast<double>(inverse_mass));
      p.volume = f.moment_constants[6 * f.places + place];
      p.displacement =
          std::is_same_v<Real, StateReal> ? to<double>(point.u) : column(f.displacement);
      p.position = m.origin + to<double>(point.x) + p.displacement;
      p.velocity = column(f.velocity);
      p.flow = m.flow;
      const int moves = inverse_mass < Real(0) ? 7 : moved ? moved[place] : 0;
      p.free = {moves & 1 ? 0.0 : 1.0, moves & 2 ? 0.0 : 1.0, moves & 4 ? 0.0 : 1.0};
      p.internal = column(force);
      p.external = column(f.external);
      p.load = column(f.load) - p.external;
      p.following = column(f.following);
      p.gravity = to<double>(f.gravity);
      for (int e = 0; e < 9; ++e) p.grad_u(e / 3, e % 3) = gradient[e * f.places + place];
      p.hourglass = m.hourglass;
      if (m.hourglass > 0) p.residual = gradient[9 * f.places + place];
      const PhyxelTotals own = totals_of(
          p, response_after_step<double>(
                 m.law_index, m.law, p.grad_u,
                 [&](int k) { return static_cast<double>(f.history[k * f.places + place]); },
                 history_interval));
      for (int k = 0; k < Sums::count; ++k) t.sum[k] = own.sum[k];
      t.sum[inverted] = own.inverted ? 1 : 0;
      if (!own.finite) t.first_bad = number_at[place];
      t.largest_displacement = fmax(own.displacement, 0.0);  // not NaN
      t.largest_speed = fmax(own.speed, 0.0);
      if (t.largest_speed > 0) t.fastest = number_at[place];
    }
    both = part == 0 ? t : combined(both, t);
  }
  const TileTotals all = of_block(both, shared);
  if (threadIdx.x == 0) totals[blockIdx.x] = all;
}

/// Adds the totals of tiles to `all`. One thread per tile.
static __global__ void add_tiles(const TileTotals* tiles, int count, ExactTotals* all) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const TileTotals& t = tiles[k];
  for (int s = 0; s < sums; ++s) add_exactly(all->word[s], t.sum[s]);
  const auto bits = [](double value) {
    return static_cast<unsigned long long>(__double_as_longlong(value));
  };
  atomicMax(&all->displacement_bits, bits(t.largest_displacement));
  atomicMax(&all->speed_bits, bits(t.largest_speed));
  atomicMin(&all->first_bad, t.first_bad);
}
/// Finds the id of the fastest phyxel. Runs after `add_tiles`.
static __global__ void find_fastest(const TileTotals* tiles, int count, ExactTotals* all) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  if (tiles[k].largest_speed == __longlong_as_double(static_cast<long long>(all->speed_bits))) {
    atomicMin(&all->fastest, tiles[k].fastest);
  }
}

/// Converts the totals on the host.
inline Totals totals_of(const ExactTotals& device) {
  Totals t;
  int s = 0;
  const auto put = [&](ExactSum& sum) {
    std::copy_n(device.word[s++], ExactSum::words, sum.ready().begin());
  };
  t.for_each_sum(put);
  ExactSum turned;
  put(turned);
  t.inverted = static_cast<std::int64_t>(turned.value());
  t.largest_displacement = std::bit_cast<double>(device.displacement_bits);
  t.largest_speed = std::bit_cast<double>(device.speed_bits);
  t.fastest = device.fastest == no_phyxel ? -1 : device.fastest;
  t.first_bad = device.first_bad;
  return t;
}

}  // namespace phyxel::cuda
