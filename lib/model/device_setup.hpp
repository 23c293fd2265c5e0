/// Building of models with the help of a device.
#pragma once

#include <span>

#include "model/closure.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// What a device does when a model is built; what is empty is the host's.
struct DeviceSetup {
  Surveyor survey;  ///< Finds neighbourhoods, and leaves their lists on the device.
  /// Closes gradients; if the device has searched for neighbours, from lists that it makes anew.
  ClosingSearch close;
};

/// Builds the model as `build_model(scene)` does, with the same bits.
Model build_model(const Scene& scene, const DeviceSetup& device);
/// The same from clouds already in place, one for each body of the scene.
Model build_model(const Scene& scene, std::span<const Cloud> clouds, const DeviceSetup& device);

}  // namespace phyxel
