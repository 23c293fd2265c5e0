/// The motion of a model's phyxels, kept while a step is tried.
#pragma once

#include "solver/contacts.cuh"
#include "solver/device_model.cuh"

namespace phyxel::cuda {

/// Copies displacements [m] and velocities [m/s], shape [places] each. One thread per place.
template <class Real, class StateReal>
__global__ void keep_motion(Fields<Real, StateReal> f, Vec3<double>* displacement,
                            Vec3<double>* velocity) {
  const auto at = static_cast<Index>(blockIdx.x * blockDim.x + threadIdx.x);
  displacement[at] = displacement_at(f, at);
  velocity[at] = to<double>(column3(f.velocity, f.places, at));
}

/// Puts them back. One thread per place.
template <class Real, class StateReal>
__global__ void put_motion_back(Fields<Real, StateReal> f, const Vec3<double>* displacement,
                                const Vec3<double>* velocity) {
  const auto at = static_cast<Index>(blockIdx.x * blockDim.x + threadIdx.x);
  move_to(f, at, displacement[at], velocity[at]);
}

/// The displacements and velocities that a model has where this is made.
template <class Real, class StateReal>
class KeptMotion {
 public:
  /// @param model must outlive this
  explicit KeptMotion(const DeviceModel<Real, StateReal>& model)
      : m_(model), displacement_(m_.places(), name), velocity_(m_.places(), name) {
    m_.launch_places("keep_motion", keep_motion<Real, StateReal>, m_.fields(), displacement_.data(),
                     velocity_.data());
  }
  /// Gives them back to the model.
  void put_back() const {
    m_.launch_places("put_motion_back", put_motion_back<Real, StateReal>, m_.fields(),
                     displacement_.data(), velocity_.data());
  }

 private:
  static constexpr const char* name = "a trial step";

  const DeviceModel<Real, StateReal>& m_;
  DeviceArray<Vec3<double>> displacement_, velocity_;
};

}  // namespace phyxel::cuda
