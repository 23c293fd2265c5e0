/// Filling of closed surfaces on a GPU.
#pragma once

#include <memory>

#include "mesh/filling_device.hpp"

namespace phyxel {

/// A GPU that places nodes, evens out their distances and finds their volumes, with the bits of the
/// host. Its methods throw DeviceError.
/// @param least number of phyxels below which it leaves bodies to the host
std::shared_ptr<const FillingDevice> cuda_filling_device(int device = 0,
                                                         Index least = least_filled_by_device);

}  // namespace phyxel
