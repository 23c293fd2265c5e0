/// Energies, momenta and finiteness, summed where the state is. Sums run in double over a tile in a
/// fixed tree, and over tiles without rounding, so that they depend on nothing but the model: not
/// on the order of tiles, nor on which rank has which.
#pragma once

#include <cstdint>

#include "exact_sum.hpp"
#include "phyxel/physics/verlet.hpp"
#include "solver/kernels.cuh"
#include "solver/totals.hpp"

namespace phyxel::cuda {

/// What the sums need of a tile's body.
struct TileMaterial {
  double law[law_numbers];  ///< As `ChosenLaw::constants`.
  int law_index;            ///< In `Laws`.
  double volume_stiffness, hourglass;
  DampedFlow flow;      ///< From the time of the velocities to that of the displacements.
  Vec3<double> origin;  ///< What positions are taken from [m].
};

/// Everything that adds up, in the order of `Totals::for_each_sum`.
enum Sum : int {
  kinetic_energy,
  strain_energy,
  volume_energy,
  hourglass_energy,
  plastic_work,
  viscous_work,
  gravity_energy,
  load_energy,
  force_scale,
  torque_scale,
  momentum,  // three components each
  angular_momentum = momentum + 3,
  internal_force = angular_momentum + 3,
  internal_torque = internal_force + 3,
  inverted = internal_torque + 3,  // last: a number of phyxels
  sums
};

inline constexpr Index no_phyxel = INT32_MAX;

/// Sums and extremes of phyxels of one tile. Phyxels go by their numbers in the whole model.
struct TileTotals {
  double sum[sums];
  double largest_displacement, largest_speed;
  Index fastest, first_bad;  ///< `no_phyxel` if there is none. Of equals the first.
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

/// The block's totals in thread 0, by halving.
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

/// Sums without rounding (`ExactSum`), and extremes as what atomic operations compare.
struct ExactTotals {
  unsigned long long word[sums][ExactSum::words];
  unsigned long long displacement_bits, speed_bits;  ///< Of doubles that are not negative.
  Index fastest, first_bad;
};

__device__ inline void add_exactly(unsigned long long* words, double value) {
  ExactSum::split(value, [&](int word, std::int64_t number) {
    if (number != 0) atomicAdd(words + word, static_cast<unsigned long long>(number));
  });
}

template <class T>
__device__ void put3(double* sum, Vec3<T> v) {
  sum[0] = v.x;
  sum[1] = v.y;
  sum[2] = v.z;
}
inline constexpr int diagnose_threads = 128;

/// @param force,gradient of the present displacements; with hourglass control, row 9 of `gradient`
///   has the residuals
/// @param history_interval time from what laws remember to the displacements [s]
/// @param moved along which axes phyxels follow a path (`Axes::bits`), or null
/// @param number_at of each place: its phyxel's number
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
    if (inverse_mass != Real(0)) {  // somebody is there
      const TileMaterial m = materials[blockIdx.x];
      const bool held = inverse_mass < Real(0);
      const double mass = 1 / fabs(static_cast<double>(inverse_mass));
      const auto point = f.points.get(place);
      const Vec3<double> u = std::is_same_v<Real, StateReal>
                                 ? to<double>(point.u)
                                 : to<double>(column3(f.displacement, f.places, place));
      const Vec3<double> x = m.origin + to<double>(point.x) + u;
      const Vec3<double> internal = to<double>(column3(force, f.places, place));
      const Vec3<double> load =
          f.load ? to<double>(column3(f.load, f.places, place)) : Vec3<double>{};
      const Vec3<double> half_step_velocity = to<double>(column3(f.velocity, f.places, place));
      const Vec3<double> gravity = to<double>(f.gravity);
      Mat3<double> grad_u;
      double trace_of_all = 0;
      for (int e = 0; e < 9; ++e) {
        grad_u(e / 3, e % 3) = gradient[e * f.places + place];
        trace_of_all += grad_u(e / 3, e % 3);
      }
      const double finite = trace_of_all + u.x + u.y + u.z + internal.x + internal.y + internal.z +
                            half_step_velocity.x + half_step_velocity.y + half_step_velocity.z;
      if (!isfinite(finite)) t.first_bad = number_at[place];

      const Vec3<double> acceleration = (1 / mass) * (internal + load) + gravity;
      const Vec3<double> change =
          m.flow.gain * acceleration - (1 - m.flow.keep) * half_step_velocity;
      const int moves = held ? 7 : moved ? moved[place] : 0;
      Vec3<double> v = half_step_velocity;
      if (!(moves & 1)) v.x += change.x;
      if (!(moves & 2)) v.y += change.y;
      if (!(moves & 4)) v.z += change.z;
      const Vec3<double> p = mass * v;
      t.sum[kinetic_energy] = 0.5 * dot(p, v);
      put3(t.sum + momentum, p);
      put3(t.sum + angular_momentum, cross(x, p));
      t.sum[gravity_energy] = -mass * dot(gravity, u);
      const Vec3<double> external =
          f.external ? to<double>(column3(f.external, f.places, place)) : Vec3<double>{};
      t.sum[load_energy] = -dot(load - external, u);
      const double volume = f.moment_constants[6 * f.places + place];
      const PointResponse<double> response = response_after_step<double>(
          m.law_index, m.law, grad_u,
          [&](int k) { return static_cast<double>(f.history[k * f.places + place]); },
          history_interval);
      t.sum[strain_energy] = volume * response.strain_energy;
      t.sum[volume_energy] = volume * response.volume_energy;
      t.sum[plastic_work] = volume * response.plastic_work;
      t.sum[viscous_work] = volume * response.viscous_work;
      if (m.hourglass > 0) {
        t.sum[hourglass_energy] =
            phyxel::hourglass_energy(m.hourglass, gradient[9 * f.places + place]);
      }
      t.sum[inverted] = volume_change(grad_u) <= -1 ? 1 : 0;
      put3(t.sum + internal_force, internal);
      put3(t.sum + internal_torque, cross(x, internal));
      t.sum[force_scale] = sqrt(dot(internal, internal));
      t.sum[torque_scale] = sqrt(dot(x, x)) * t.sum[force_scale];
      t.largest_displacement = fmax(sqrt(dot(u, u)), 0.0);  // not NaN
      t.largest_speed = fmax(sqrt(dot(v, v)), 0.0);
      if (t.largest_speed > 0) t.fastest = number_at[place];
    }
    both = part == 0 ? t : combined(both, t);
  }
  const TileTotals all = of_block(both, shared);
  if (threadIdx.x == 0) totals[blockIdx.x] = all;
}

/// A thread a tile: adds it to `all`.
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
/// After `add_tiles`: who is the fastest.
static __global__ void find_fastest(const TileTotals* tiles, int count, ExactTotals* all) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  if (tiles[k].largest_speed == __longlong_as_double(static_cast<long long>(all->speed_bits))) {
    atomicMin(&all->fastest, tiles[k].fastest);
  }
}

/// On the host.
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
