/// Fields of distances in device memory.
#pragma once

#include <cstdint>
#include <string>

#include "mesh/distance_field.hpp"
#include "setup/primitives.cuh"

namespace phyxel::cuda {

/// The arrays of a field of distances.
class DeviceDistances {
 public:
  DeviceDistances() = default;
  DeviceDistances(const DistanceArrays& distances, const std::string& what)
      : field_(distances.shape),
        brick_(sent(distances.brick, what)),
        coarse_(sent(distances.coarse, what)),
        fine_(sent(distances.fine, what)) {}

  /// A view for kernels, which this must outlive.
  DistanceField view() const {
    DistanceField field = field_;
    field.brick = brick_.data();
    field.coarse = coarse_.data();
    field.fine = fine_.data();
    return field;
  }
  std::size_t bytes() const { return brick_.bytes() + coarse_.bytes() + fine_.bytes(); }

 private:
  DistanceField field_;
  DeviceArray<std::int32_t> brick_;
  DeviceArray<float> coarse_, fine_;
};

}  // namespace phyxel::cuda
