/// Vectors of three numbers a place, for the largest eigenfrequency. One thread a place. Products
/// do not depend on the order of tiles, nor on which rank has which.
#pragma once

#include <limits>

#include "solver/passes.cuh"
#include "solver/start_vector.hpp"

namespace phyxel::cuda {

template <class Real>
__global__ void start_vector(Real* vector, std::size_t places, const Index* number_at) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Index i = number_at[place];
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
__global__ void subtract_multiple(Real* y, const Real* x, std::size_t places, Real alpha) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  for (int e = 0; e < 3; ++e) y[e * places + place] -= alpha * x[e * places + place];
}

template <class Real>
__global__ void scale_vector(Real* x, std::size_t places, Real factor) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  for (int e = 0; e < 3; ++e) x[e * places + place] *= factor;
}

/// a · b, over a tile in a fixed tree, over tiles without rounding into an `ExactSum`'s words.
template <class Real>
__global__ void multiply_tiles(const Real* a, const Real* b, std::size_t places,
                               unsigned long long* words) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  double sum = 0;
  for (int e = 0; e < 3; ++e) {
    sum += static_cast<double>(a[e * places + place]) * static_cast<double>(b[e * places + place]);
  }
  __shared__ double shared[tile_size];
  shared[threadIdx.x] = sum;
  for (int half = tile_size / 2; half > 0; half /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < half) shared[threadIdx.x] += shared[threadIdx.x + half];
  }
  if (threadIdx.x == 0) add_exactly(words, shared[0]);
}

/// M^-1/2 K M^-1/2 at rest, by the linear law that every material has there.
template <class Real, class StateReal>
class CudaVibration final : public Vibration {
 public:
  CudaVibration(const DeviceModel<Real, StateReal>& model, const Passes<Real, StateReal>& passes)
      : m_(model),
        passes_(passes),
        amplitude_(amplitude_at_rest(model.model())),
        tiles_(model.rest_constants()),
        product_(ExactSum::words, "sums") {
    const std::string what = "vectors of " + m_.subject();
    const std::size_t count = 3 * m_.places();
    previous_ = {count, what};
    current_ = {count, what};
    next_ = {count, what};
    force_ = {count, what};
    previous_.clear();
    m_.launch_tiles("start_vector", start_vector<Real>, current_.data(), m_.places(),
                    m_.number_at());
    scale(current_, 1 / std::sqrt(product(current_, current_)));
  }
  double apply(double beta) override {
    m_.use_device();
    m_.launch_tiles("bend", bend<Real, StateReal>, m_.fields(), current_.data(), amplitude_);
    passes_.send_displacements();
    passes_.linear_stress(tiles_.data());
    passes_.gather(force_.data());
    m_.launch_tiles("stiffness_times", stiffness_times<Real, StateReal>, m_.fields(), force_.data(),
                    previous_.data(), static_cast<Real>(beta), amplitude_, next_.data());
    return product(next_, current_);
  }
  double subtract(double alpha) override {
    m_.use_device();
    m_.launch_tiles("subtract", subtract_multiple<Real>, next_.data(), current_.data(), m_.places(),
                    static_cast<Real>(alpha));
    return std::sqrt(product(next_, next_));
  }
  void advance(double norm) override {
    m_.use_device();
    std::swap(previous_, current_);
    std::swap(current_, next_);
    scale(current_, 1 / norm);
  }

 private:
  /// Makes displacements of a vector's ones the size of a support: smallest support times the root
  /// of the smallest mass. Forces of a unit vector then stay as far from the ends of float as those
  /// of a step.
  static Real amplitude_at_rest(const Model& model) {
    double support = 0, mass = 0;
    for (Index i = 0; i < model.size(); ++i) {
      const double h = model.neighbourhood.support[i], m = model.mass[i];
      if (h > 0 && (support == 0 || h < support)) support = h;
      if (m > 0 && (mass == 0 || m < mass)) mass = m;
    }
    if (model.share) {
      // Of all ranks; a rank may have nobody.
      const auto smallest = [&](double value) {
        const double nobody = std::numeric_limits<double>::infinity();
        const double all = model.share->others->smallest(value > 0 ? value : nobody);
        return all < nobody ? all : 0;
      };
      support = smallest(support);
      mass = smallest(mass);
    }
    return support > 0 && mass > 0 ? static_cast<Real>(support * std::sqrt(mass)) : Real(1);
  }
  double product(const DeviceArray<Real>& a, const DeviceArray<Real>& b) const {
    product_.clear(m_.stream());
    m_.launch_tiles("multiply_tiles", multiply_tiles<Real>, a.data(), b.data(), m_.places(),
                    product_.data());
    m_.wait();
    ExactSum sum;
    std::ranges::copy(fetched(product_), sum.ready().begin());
    if (m_.share()) m_.share()->others->add(sum.ready());
    return sum.value();
  }
  void scale(DeviceArray<Real>& a, double factor) {
    m_.launch_tiles("scale", scale_vector<Real>, a.data(), m_.places(), static_cast<Real>(factor));
  }

  const DeviceModel<Real, StateReal>& m_;
  const Passes<Real, StateReal>& passes_;
  Real amplitude_;
  DeviceArray<TileConstants<Real, StateReal>> tiles_;
  DeviceArray<unsigned long long> product_;
  DeviceArray<Real> previous_, current_, next_, force_;
};

}  // namespace phyxel::cuda
