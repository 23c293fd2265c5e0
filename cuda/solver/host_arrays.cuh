/// Copies between arrays of the host, by phyxel and in double, and the fields, by tile slot.
#pragma once

#include "phyxel/types.hpp"
#include "solver/kernels.cuh"

namespace phyxel::cuda {

/// Constants of a model: those of the host by phyxel, those computed on the GPU by tile slot.
struct Constants {
  const Index* phyxel_at;  ///< [places]; -1 if the slot is empty
  const Vec3d* position;   ///< [n]
  const double *volume, *mass, *support;
  const char* held;             ///< [n], or null if no phyxel is fixed.
  const Sym3d* inverse_moment;  ///< [places]
  const Vec3d* moment_offset;   ///< [places]
  const Vec3d* origin;          ///< [tiles], origin of positions [m]
};

/// Sets the constants (rest positions, moments, volumes, masses, supports), and displacements to
/// zero. One thread per tile slot.
template <class Real, class StateReal>
__global__ void put_constants(Fields<Real, StateReal> f, Constants c, Real* moment_constants,
                              Real* force_constants, Real* inverse_h_squared) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Index i = c.phyxel_at[place];
  Sym3d a;
  Vec3d b;
  double volume = 0, inverse_mass = 0, inverse_h2 = 0;
  typename Points<Real>::Value point{};
  if (i >= 0) {
    a = c.inverse_moment[place];
    b = c.moment_offset[place];
    volume = c.volume[i];
    inverse_mass = (c.held && c.held[i] ? -1 : 1) / c.mass[i];
    const double h = c.support[i];
    inverse_h2 = h > 0 ? 1 / (h * h) : 0;
    point.x = to<Real>(c.position[i] - c.origin[blockIdx.x]);
  }
  const double moments[] = {a.xx, a.xy, a.xz, a.yy, a.yz, a.zz, volume};
  for (int r = 0; r < 7; ++r)
    moment_constants[r * f.places + place] = static_cast<Real>(moments[r]);
  const double forces[] = {b.x, b.y, b.z, inverse_mass};
  for (int r = 0; r < 4; ++r) force_constants[r * f.places + place] = static_cast<Real>(forces[r]);
  if (inverse_h_squared) inverse_h_squared[place] = static_cast<Real>(inverse_h2);
  f.points.set(place, point);
}

/// Copies displacements and velocities by phyxel into the fields.
template <class Real, class StateReal>
__global__ void put_state(Fields<Real, StateReal> f, const Index* phyxel_at,
                          const Vec3d* displacement, const Vec3d* velocity) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Index i = phyxel_at[place];
  const Vec3d u = i >= 0 ? displacement[i] : Vec3d{}, v = i >= 0 ? velocity[i] : Vec3d{};
  set_column3(f.velocity, f.places, place, to<StateReal>(v));
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, place, to<StateReal>(u));
  }
  auto point = f.points.get(place);
  point.u = to<Real>(u);
  f.points.set(place, point);
}

/// Copies displacements by phyxel into the fields.
template <class Real, class StateReal>
__global__ void set_displacements(Fields<Real, StateReal> f, const Index* phyxel_at,
                                  const Vec3d* displacement) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Index i = phyxel_at[place];
  if (i < 0) return;
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, place, to<StateReal>(displacement[i]));
  }
  auto point = f.points.get(place);
  point.u = to<Real>(displacement[i]);
  f.points.set(place, point);
}

/// Copies displacements and velocities from the fields to arrays by phyxel.
template <class Real, class StateReal>
__global__ void take_state(Fields<Real, StateReal> f, const Index* phyxel_at, Vec3d* displacement,
                           Vec3d* velocity) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Index i = phyxel_at[place];
  if (i < 0) return;
  velocity[i] = to<double>(column3(f.velocity, f.places, place));
  if constexpr (std::is_same_v<Real, StateReal>) {
    displacement[i] = to<double>(f.points.get(place).u);
  } else {
    displacement[i] = to<double>(column3(f.displacement, f.places, place));
  }
}

}  // namespace phyxel::cuda
