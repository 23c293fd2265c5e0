/// The device that a command runs on: what --device says, or what there is.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "device.hpp"
#include "phyxel/backend.hpp"

namespace phyxel::app {

struct ChosenDevice {
  std::optional<Device> gpu;  ///< Nothing: the CPU.
  std::string why_no_gpu;     ///< Where there is none.
};

inline constexpr const char* device_help = "auto, cpu, cuda or cuda:<number>";

/// Whether it is one of those names. @throws InputError naming `where` it was said
void check_device_name(const std::string& name, const std::string& where);

/// "auto" is the first GPU, or the CPU if there is none or it cannot be used (which is said).
/// @throws InputError for another name; DeviceError if a GPU is asked for and cannot be used.
ChosenDevice choose_device(const std::string& name, const std::string& where = "--device");

/// The model of a scene, its neighbours sought on the device that will step it.
Model make_model(const Scene& scene, const ChosenDevice& device);
/// The same from clouds in place.
Model make_model(const Scene& scene, std::span<const Cloud> clouds, const ChosenDevice& device);

/// @param threads of the CPU
std::unique_ptr<Backend> make_backend(const Model& model, Precision precision,
                                      const ChosenDevice& device, int threads);

}  // namespace phyxel::app
