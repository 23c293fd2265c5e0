/// Energies, momenta and finiteness, summed where the state is. Sums run in double: over a tile in
/// a fixed tree, over tiles in a fixed tree, so that they do not depend on anything but the model.
#pragma once

#include "solver/kernels.cuh"

namespace phyxel::cuda {

/// What the sums need of a tile's body.
struct TileMaterial {
  double lambda, mu, volume_stiffness, damping;
  Vec3<double> origin;  ///< What positions are taken from [m].
  int green;
};

/// Everything that adds up.
enum Sum : int {
  kinetic_energy,
  strain_energy,
  volume_energy,
  gravity_energy,
  load_energy,
  momentum,  // three components each
  angular_momentum = momentum + 3,
  internal_force = angular_momentum + 3,
  internal_torque = internal_force + 3,
  force_scale = internal_torque + 3,
  torque_scale,
  inverted,
  sums
};

/// One tile's, or all tiles', sums and extremes.
struct Totals {
  double sum[sums];
  double largest_displacement, largest_speed;
  Index fastest, first_bad;  ///< Places; -1: none.
};

__device__ inline Totals combined(const Totals& a, const Totals& b) {
  Totals t;
  for (int k = 0; k < sums; ++k) t.sum[k] = a.sum[k] + b.sum[k];
  t.largest_displacement = fmax(a.largest_displacement, b.largest_displacement);
  const bool b_is_faster = b.largest_speed > a.largest_speed;
  t.largest_speed = b_is_faster ? b.largest_speed : a.largest_speed;
  t.fastest = b_is_faster ? b.fastest : a.fastest;
  t.first_bad = a.first_bad < 0 ? b.first_bad : a.first_bad;
  return t;
}

/// The block's totals in thread 0, by halving.
__device__ inline Totals of_block(Totals mine, Totals* shared) {
  shared[threadIdx.x] = mine;
  for (unsigned half = blockDim.x / 2; half > 0; half /= 2) {
    __syncthreads();
    if (threadIdx.x < half) {
      shared[threadIdx.x] = combined(shared[threadIdx.x], shared[threadIdx.x + half]);
    }
  }
  return shared[0];
}

template <class T>
__device__ void put3(double* sum, Vec3<T> v) {
  sum[0] = v.x;
  sum[1] = v.y;
  sum[2] = v.z;
}
inline constexpr int diagnose_threads = 128;

/// @param force,gradient of the present displacements
/// @param moved phyxels on a path, or null
template <class Real, class StateReal>
__global__ void diagnose_tiles(const __grid_constant__ Fields<Real, StateReal> f,
                               const TileMaterial* materials, const char* moved, const Real* force,
                               const Real* gradient, double dt, Totals* totals) {
  __shared__ Totals shared[diagnose_threads];
  Totals both{};
  both.fastest = both.first_bad = -1;
  for (int part = 0; part < tile_size / diagnose_threads; ++part) {
    const std::size_t place =
        static_cast<std::size_t>(blockIdx.x) * tile_size + part * diagnose_threads + threadIdx.x;
    const Real inverse_mass = f.force_constants[3 * f.places + place];
    Totals t{};
    t.fastest = t.first_bad = -1;
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
      if (!isfinite(finite)) t.first_bad = static_cast<Index>(place);

      const Vec3<double> acceleration =
          (1 / mass) * (internal + load) + gravity - m.damping * half_step_velocity;
      const bool on_a_path = held || (moved && moved[place]);
      const Vec3<double> v =
          on_a_path ? half_step_velocity : half_step_velocity + (dt / 2) * acceleration;
      const Vec3<double> p = mass * v;
      t.sum[kinetic_energy] = 0.5 * dot(p, v);
      put3(t.sum + momentum, p);
      put3(t.sum + angular_momentum, cross(x, p));
      t.sum[gravity_energy] = -mass * dot(gravity, u);
      t.sum[load_energy] = -dot(load, u);
      const double volume = f.moment_constants[6 * f.places + place];
      const Hooke<double> hooke{m.lambda, m.mu};
      t.sum[strain_energy] = volume * (m.green ? GreenHooke<double>{hooke}.energy(grad_u)
                                               : CauchyHooke<double>{hooke}.energy(grad_u));
      const VolumeConservation<double> conservation{m.volume_stiffness};
      if (m.volume_stiffness > 0) t.sum[volume_energy] = volume * conservation.energy(grad_u);
      t.sum[inverted] = conservation.volume_change(grad_u) <= -1 ? 1 : 0;
      put3(t.sum + internal_force, internal);
      put3(t.sum + internal_torque, cross(x, internal));
      t.sum[force_scale] = sqrt(dot(internal, internal));
      t.sum[torque_scale] = sqrt(dot(x, x)) * t.sum[force_scale];
      t.largest_displacement = sqrt(dot(u, u));
      t.largest_speed = sqrt(dot(v, v));
      t.fastest = static_cast<Index>(place);
    }
    both = part == 0 ? t : combined(both, t);
  }
  const Totals all = of_block(both, shared);
  if (threadIdx.x == 0) totals[blockIdx.x] = all;
}

/// One block: totals of all tiles, into `result`.
__global__ inline void add_tiles(const Totals* tiles, int count, Totals* result) {
  __shared__ Totals shared[diagnose_threads];
  Totals mine{};
  mine.fastest = mine.first_bad = -1;
  // Each thread takes a run of tiles, so that what comes first stays first.
  const int run = (count + diagnose_threads - 1) / diagnose_threads;
  const int begin = static_cast<int>(threadIdx.x) * run;
  for (int k = begin; k < begin + run && k < count; ++k) {
    mine = k == begin ? tiles[k] : combined(mine, tiles[k]);
  }
  const Totals all = of_block(mine, shared);
  if (threadIdx.x == 0) *result = all;
}

}  // namespace phyxel::cuda
