/// The GPUs of this machine. No CUDA header is needed to include this, and a program built without
/// CUDA has it too: it then finds none and says why.
#pragma once

#include <string>
#include <vector>

#include "phyxel/device.hpp"

namespace phyxel {

/// The devices found; if there are none, `why` says for what reason.
std::vector<Device> cuda_devices(std::string* why = nullptr);

/// Makes a device the current one of this thread.
/// @throws DeviceError if this program was built without CUDA, if there is no such device, if the
///   driver is too old, or if the program holds no kernels for the device's architecture.
Device use_cuda_device(int index = 0);

/// Whether kernels of one device may read and write another's memory.
bool cuda_peers(int from, int to);

/// Bytes free on the current device.
std::size_t cuda_free_memory();

/// By how much the free memory of the current device falls while `bytes` are allocated.
/// @throws DeviceError if they do not fit, naming `what`.
std::size_t cuda_measured_allocation(std::size_t bytes, const std::string& what);

/// Bytes per second that the current device copies between two arrays of 1 GiB (or a quarter of
/// what is free), reads and writes both counted; best of five.
double cuda_copy_bandwidth();

/// Toolkit and driver, e.g. "CUDA 13.0, driver for 13.0"; "no CUDA" if built without.
std::string cuda_version();

}  // namespace phyxel
