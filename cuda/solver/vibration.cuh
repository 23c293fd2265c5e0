/// Vectors of three numbers a place, for the largest eigenfrequency. One thread a place.
#pragma once

#include "solver/crossings.cuh"
#include "solver/start_vector.hpp"

namespace phyxel::cuda {

template <class Real>
__global__ void start_vector(Real* vector, std::size_t places, const Index* phyxel_at) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Index i = phyxel_at[place];
  set_column3(vector, places, place, i >= 0 ? to<Real>(start_component(i)) : Vec3<Real>{});
}

template <class Real>
__device__ Real root_of_inverse_mass(const Real* force_constants, std::size_t places,
                                     std::size_t place) {
  const Real signed_inverse = force_constants[3 * places + place];
  return sqrt(signed_inverse < Real(0) ? -signed_inverse : signed_inverse);  // held: taken as free
}

/// u = a M^-1/2 x
template <class Real, class StateReal>
__global__ void bend(Fields<Real, StateReal> f, const Real* x, Real amplitude) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  auto point = f.points.get(place);
  const Real scale = amplitude * root_of_inverse_mass(f.force_constants, f.places, place);
  point.u = scale * column3(x, f.places, place);
  f.points.set(place, point);
}

/// y = -M^-1/2 f / a - beta x
template <class Real, class StateReal>
__global__ void stiffness_times(Fields<Real, StateReal> f, const Real* force, const Real* x,
                                Real beta, Real amplitude, Real* y) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Real scale = -root_of_inverse_mass(f.force_constants, f.places, place) / amplitude;
  set_column3(y, f.places, place,
              scale * column3(force, f.places, place) - beta * column3(x, f.places, place));
}

/// y -= alpha x
template <class Real>
__global__ void subtract_multiple(Real* y, const Real* x, Real alpha) {
  const std::size_t k = 3 * (static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x);
  for (int e = 0; e < 3; ++e) y[k + e] -= alpha * x[k + e];
}

template <class Real>
__global__ void scale_vector(Real* x, Real factor) {
  const std::size_t k = 3 * (static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x);
  for (int e = 0; e < 3; ++e) x[k + e] *= factor;
}

/// The terms of a scalar product.
template <class Real>
struct Product {
  const Real *a, *b;
  __device__ double operator()(std::int64_t k) const {
    return static_cast<double>(a[k]) * static_cast<double>(b[k]);
  }
};

}  // namespace phyxel::cuda
