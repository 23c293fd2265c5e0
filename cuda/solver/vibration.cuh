/// Vectors with three numbers per tile slot for the largest eigenfrequency. Kernels run one thread
/// per tile slot. Products depend neither on the order of tiles nor on their distribution over
/// ranks.
#pragma once

#include <bit>
#include <limits>

#include "solver/passes.cuh"
#include "solver/start_vector.hpp"

namespace phyxel::cuda {

/// The axes along which phyxels are held or moved, on a device.
template <class Real>
struct PrescribedAxes {
  const Real* force_constants;  ///< Negative inverse masses mark phyxels that are fixed.
  std::size_t places;
  const char* moved;  ///< `Boundary::moved`.
  bool none;          ///< True if components along all axes count.
  __device__ int operator[](std::size_t place) const {
    if (none) return 0;
    if (force_constants[3 * places + place] < Real(0)) return 7;
    return moved ? moved[place] : 0;
  }
};

template <class Real>
__global__ void start_vector(Real* vector, PrescribedAxes<Real> prescribed,
                             const Index* number_at) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Index i = number_at[place];
  const Vec3<Real> random = i >= 0 ? to<Real>(start_component(i)) : Vec3<Real>{};
  set_column3(vector, prescribed.places, place, free_components(random, prescribed[place]));
}

template <class Real>
__device__ Real root_of_inverse_mass(const Real* force_constants, std::size_t places,
                                     std::size_t place) {
  const Real signed_inverse = force_constants[3 * places + place];
  return sqrt(signed_inverse < Real(0) ? -signed_inverse : signed_inverse);  // < 0: fixed
}

/// Computes u = a M^-1/2 x.
template <class Real, class StateReal>
__global__ void bend(Fields<Real, StateReal> f, const Real* x, Real amplitude) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  auto point = f.points.get(place);
  const Real scale = amplitude * root_of_inverse_mass(f.force_constants, f.places, place);
  point.u = scale * column3(x, f.places, place);
  f.points.set(place, point);
}

/// Computes u = there + a M^-1/2 x.
template <class Real, class StateReal>
__global__ void bend_from(Fields<Real, StateReal> f, const Real* there, const Real* x,
                          Real amplitude) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  auto point = f.points.get(place);
  const Real scale = amplitude * root_of_inverse_mass(f.force_constants, f.places, place);
  point.u = column3(there, f.places, place) + scale * column3(x, f.places, place);
  f.points.set(place, point);
}

template <class Real, class StateReal>
__global__ void keep_displacements(Fields<Real, StateReal> f, Real* kept) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  set_column3(kept, f.places, place, f.points.get(place).u);
}

template <class Real, class StateReal>
__global__ void put_displacements(Fields<Real, StateReal> f, const Real* kept) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  auto point = f.points.get(place);
  point.u = column3(kept, f.places, place);
  f.points.set(place, point);
}

/// Finds the largest |M^-1/2 x| of a tile slot, as the bits of a float: bits of non-negative floats
/// have the order of the floats.
template <class Real, class StateReal>
__global__ void find_farthest(Fields<Real, StateReal> f, const Real* x, unsigned* largest) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Vec3<Real> v = column3(x, f.places, place);
  const auto length = static_cast<float>(sqrt(dot(v, v)) *
                                         root_of_inverse_mass(f.force_constants, f.places, place));
  __shared__ float shared[tile_size];
  shared[threadIdx.x] = length;
  for (int half = tile_size / 2; half > 0; half /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < half) {
      shared[threadIdx.x] = fmaxf(shared[threadIdx.x], shared[threadIdx.x + half]);
    }
  }
  if (threadIdx.x == 0) atomicMax(largest, __float_as_uint(shared[0]));
}

/// Computes y = -M^-1/2 f / a - beta x, with forces along free axes.
template <class Real, class StateReal>
__global__ void stiffness_times(Fields<Real, StateReal> f, PrescribedAxes<Real> prescribed,
                                const Real* force, const Real* x, Real beta, Real amplitude,
                                Real* y) {
  const std::size_t place = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  const Real scale = -root_of_inverse_mass(f.force_constants, f.places, place) / amplitude;
  const Vec3<Real> free = free_components(column3(force, f.places, place), prescribed[place]);
  set_column3(y, f.places, place, scale * free - beta * column3(x, f.places, place));
}

/// Computes y -= alpha x.
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

/// Adds a · b to the words of an `ExactSum`: in a fixed tree over a tile, without rounding over
/// tiles.
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

/// The vectors of the Lanczos iteration on M^-1/2 K M^-1/2, on the device. Derived classes apply
/// the stiffness K.
template <class Real, class StateReal>
class CudaLanczosVectors : public Vibration {
 public:
  /// @param moved `Boundary::moved`
  CudaLanczosVectors(const DeviceModel<Real, StateReal>& model,
                     const Passes<Real, StateReal>& passes, const char* moved)
      : m_(model),
        passes_(passes),
        prescribed_{model.fields().force_constants, model.places(), moved, false},
        product_(ExactSum::words, "sums") {
    const std::string what = "vectors of " + m_.subject();
    const std::size_t count = 3 * m_.places();
    previous_ = {count, what};
    current_ = {count, what};
    next_ = {count, what};
    force_ = {count, what};
    previous_.clear();
    double length = start();
    if (!(length > 0)) {  // no component is free
      prescribed_.none = true;
      length = start();
    }
    scale(current_, 1 / length);
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

 protected:
  const DeviceModel<Real, StateReal>& model() const { return m_; }
  const Passes<Real, StateReal>& passes() const { return passes_; }
  const DeviceArray<Real>& current() const { return current_; }
  const DeviceArray<Real>& force() const { return force_; }
  /// Computes next = -M^-1/2 force / a - beta previous. @returns next · current
  double times_stiffness(Real amplitude, double beta) {
    m_.launch_tiles("stiffness_times", stiffness_times<Real, StateReal>, m_.fields(), prescribed_,
                    force_.data(), previous_.data(), static_cast<Real>(beta), amplitude,
                    next_.data());
    return product(next_, current_);
  }

 private:
  /// Fills `current` with the free components of random numbers. @returns |current|
  double start() {
    m_.launch_tiles("start_vector", start_vector<Real>, current_.data(), prescribed_,
                    m_.number_at());
    return std::sqrt(product(current_, current_));
  }
  double product(const DeviceArray<Real>& a, const DeviceArray<Real>& b) const {
    product_.clear(m_.stream());
    m_.launch_tiles("multiply_tiles", multiply_tiles<Real>, a.data(), b.data(), m_.places(),
                    product_.data());
    m_.wait();
    ExactSum sum;
    std::ranges::copy(fetched(product_), sum.ready().begin());
    if (m_.share()) m_.share()->communicator->add(sum.ready());
    return sum.value();
  }
  void scale(DeviceArray<Real>& a, double factor) {
    m_.launch_tiles("scale", scale_vector<Real>, a.data(), m_.places(), static_cast<Real>(factor));
  }

  const DeviceModel<Real, StateReal>& m_;
  const Passes<Real, StateReal>& passes_;
  PrescribedAxes<Real> prescribed_;
  DeviceArray<unsigned long long> product_;
  DeviceArray<Real> previous_, current_, next_, force_;
};

/// The stiffness at rest, by the linearisation of every law.
template <class Real, class StateReal>
class CudaVibration final : public CudaLanczosVectors<Real, StateReal> {
  using Base = CudaLanczosVectors<Real, StateReal>;

 public:
  CudaVibration(const DeviceModel<Real, StateReal>& model, const Passes<Real, StateReal>& passes,
                const char* moved)
      : Base(model, passes, moved),
        amplitude_(amplitude_at_rest(model.model())),
        tiles_(model.rest_constants()) {}
  double apply(double beta) override {
    const auto& m = this->model();
    m.use_device();
    m.launch_tiles("bend", bend<Real, StateReal>, m.fields(), this->current().data(), amplitude_);
    this->passes().send_displacements();
    this->passes().linear_stress(tiles_.data());
    this->passes().gather(this->force().data());
    return this->times_stiffness(amplitude_, beta);
  }

 private:
  /// Returns the amplitude that scales vectors to displacements, the smallest support times the
  /// root of the smallest mass: entries of one become displacements of a support, whose forces are
  /// as far from the limits of float as those of a step.
  static Real amplitude_at_rest(const phyxel::Model& model) {
    double support = 0, mass = 0;
    for (Index i = 0; i < model.size(); ++i) {
      const double h = model.neighbourhood.support[i], m = model.mass[i];
      if (h > 0 && (support == 0 || h < support)) support = h;
      if (m > 0 && (mass == 0 || m < mass)) mass = m;
    }
    if (model.share) {
      // Over all ranks; a rank may have no phyxels.
      const auto smallest = [&](double value) {
        const double nobody = std::numeric_limits<double>::infinity();
        const double all = model.share->communicator->smallest(value > 0 ? value : nobody);
        return all < nobody ? all : 0;
      };
      support = smallest(support);
      mass = smallest(mass);
    }
    return support > 0 && mass > 0 ? static_cast<Real>(support * std::sqrt(mass)) : Real(1);
  }

  Real amplitude_;
  DeviceArray<TileConstants<Real, StateReal>> tiles_;
};

/// The stiffness at the present displacements, by differences of forces there, at fixed histories,
/// since unloading is elastic. The destructor restores the displacements; velocities are not
/// touched.
template <class Real, class StateReal>
class CudaDeformedVibration final : public CudaLanczosVectors<Real, StateReal> {
  using Base = CudaLanczosVectors<Real, StateReal>;

 public:
  /// @param distance size of the displacement in differences [m]
  CudaDeformedVibration(const DeviceModel<Real, StateReal>& model,
                        const Passes<Real, StateReal>& passes, const char* moved, double distance)
      : Base(model, passes, moved),
        distance_(distance),
        present_(3 * model.places(), "displacements of " + model.subject()),
        forces_there_(3 * model.places(), "forces of " + model.subject()),
        farthest_(1, "sums") {
    model.launch_tiles("keep_displacements", keep_displacements<Real, StateReal>, model.fields(),
                       present_.data());
    passes.stress(HistoryUse::frozen, 0);
    passes.gather(forces_there_.data());
  }
  CudaDeformedVibration(const CudaDeformedVibration&) = delete;
  CudaDeformedVibration& operator=(const CudaDeformedVibration&) = delete;
  ~CudaDeformedVibration() override {
    try {
      this->model().use_device();
      this->model().launch_tiles("put_displacements", put_displacements<Real, StateReal>,
                                 this->model().fields(), present_.data());
      this->passes().send_displacements();
      this->model().wait();
    } catch (const DeviceError&) {  // the next step reports it
    }
  }

  double apply(double beta) override {
    const auto& m = this->model();
    m.use_device();
    const auto amplitude = static_cast<Real>(distance_ / farthest());
    m.launch_tiles("bend_from", bend_from<Real, StateReal>, m.fields(), present_.data(),
                   this->current().data(), amplitude);
    this->passes().send_displacements();
    this->passes().stress(HistoryUse::frozen, 0);
    this->passes().gather(this->force().data());
    m.launch_tiles("subtract", subtract_multiple<Real>, this->force().data(), forces_there_.data(),
                   m.places(), Real(1));
    return this->times_stiffness(amplitude, beta);
  }

 private:
  double farthest() {
    const auto& m = this->model();
    farthest_.clear(m.stream());
    m.launch_tiles("find_farthest", find_farthest<Real, StateReal>, m.fields(),
                   this->current().data(), farthest_.data());
    m.wait();
    const auto largest = static_cast<double>(std::bit_cast<float>(fetched(farthest_)[0]));
    return m.share() ? m.share()->communicator->largest(largest) : largest;
  }

  double distance_;
  DeviceArray<Real> present_, forces_there_;
  DeviceArray<unsigned> farthest_;
};

}  // namespace phyxel::cuda
