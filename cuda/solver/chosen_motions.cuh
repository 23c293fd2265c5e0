/// The motions of a few phyxels of a model in device memory, for the host.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "solver/contacts.cuh"
#include "solver/device_model.cuh"

namespace phyxel::cuda {

/// Numbers of a `PhyxelMotion`.
inline constexpr int numbers_of_motion = 15;

/// Copies displacements, velocities and gradients of phyxels. One thread per phyxel.
/// @param gradients shape [9, places]. @param place tile slots of the phyxels, shape [count]
/// @param motions receives them, shape [numbers_of_motion, count]
template <class Real, class StateReal>
__global__ void gather_motions(Fields<Real, StateReal> f, const Real* gradients, const Index* place,
                               int count, StateReal* motions) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const auto at = static_cast<std::size_t>(place[k]);
  const auto each = static_cast<std::size_t>(count);
  set_column3(motions, each, k, to<StateReal>(displacement_at(f, place[k])));
  set_column3(motions + 3 * each, each, k, column3(f.velocity, f.places, at));
  for (int e = 0; e < 9; ++e) {
    motions[(6 + e) * each + k] = static_cast<StateReal>(gradients[e * f.places + at]);
  }
}

/// The motions of phyxels of a model, in their order. Waits. @param gradients shape [9, places]
template <class Real, class StateReal>
std::vector<PhyxelMotion> chosen_motions(const DeviceModel<Real, StateReal>& model,
                                         const DeviceArray<Real>& gradients,
                                         std::span<const Index> phyxels) {
  if (phyxels.empty()) return {};
  const std::string what = "motions of " + model.subject();
  std::vector<Index> places;
  places.reserve(phyxels.size());
  for (const Index i : phyxels) places.push_back(model.tiling().place[i]);
  const DeviceArray<Index> place = sent(places, what);
  const std::size_t count = places.size();
  const DeviceArray<StateReal> gathered(numbers_of_motion * count, what);
  model.launch_each("gather_motions", gather_motions<Real, StateReal>, static_cast<int>(count),
                    model.fields(), gradients.data(), place.data(), static_cast<int>(count),
                    gathered.data());
  model.wait();
  const std::vector<StateReal> values = fetched(gathered);
  std::vector<PhyxelMotion> motions(count);
  const auto vector = [&](std::size_t row, std::size_t k) {
    return Vec3d{values[row * count + k], values[(row + 1) * count + k],
                 values[(row + 2) * count + k]};
  };
  for (std::size_t k = 0; k < count; ++k) {
    motions[k].displacement = vector(0, k);
    motions[k].velocity = vector(3, k);
    for (std::size_t e = 0; e < 9; ++e) {
      motions[k].gradient(static_cast<int>(e / 3), static_cast<int>(e % 3)) =
          values[(6 + e) * count + k];
    }
  }
  return motions;
}

}  // namespace phyxel::cuda
