/// The GPUs of this machine. This header does not include CUDA's, and also exists in builds without
/// CUDA, which find no GPU and give the reason.
#pragma once

#include <string>
#include <vector>

#include "phyxel/device.hpp"

namespace phyxel {

/// The devices of this machine. @param why receives the reason if there are none; may be null
std::vector<Device> cuda_devices(std::string* why = nullptr);

/// Makes a device the current one of this thread.
/// @throws DeviceError if this program was built without CUDA, if there is no such device, if the
///   driver is too old, or if the program has no kernels for the device's architecture
Device use_cuda_device(int index = 0);

/// True if kernels of one device can access the memory of another.
bool cuda_peers(int from, int to);

/// Free memory of the current device [bytes].
std::size_t cuda_free_memory();

/// Decrease of the current device's free memory by an allocation of `bytes` [bytes].
/// @throws DeviceError naming `what` if the allocation fails
std::size_t cuda_measured_allocation(std::size_t bytes, const std::string& what);

/// Copy bandwidth of the current device between two arrays of 1 GiB, or of a quarter of the free
/// memory [bytes/s], reads and writes counted; the best of five.
double cuda_copy_bandwidth();

/// Versions of toolkit and driver, e.g. "CUDA 13.0, driver for 13.0"; "no CUDA" if built without.
std::string cuda_version();

}  // namespace phyxel
