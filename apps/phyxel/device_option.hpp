/// The device that a command runs on: what --device says, or what there is.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "csv.hpp"
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

/// The device of this rank: each rank of a host takes the next of its GPUs, unless one is named,
/// and "auto" is GPUs only if all ranks find one. Collective.
ChosenDevice choose_device_of_rank(const std::string& name, const std::string& where = "--device");

/// What measurements on it are labelled with; nothing for the CPU.
Facts device_facts(const ChosenDevice& device);

/// The model of a scene, its neighbours sought on the device that will step it.
Model make_model(const Scene& scene, const ChosenDevice& device);
/// The same from clouds in place.
Model make_model(const Scene& scene, std::span<const Cloud> clouds, const ChosenDevice& device);

/// Names of `Transport`: "auto", "direct", "host".
const std::vector<std::string>& transport_names();

/// @param threads of the CPU
/// @param transport of ranks' GPUs
std::unique_ptr<Backend> make_backend(const Model& model, Precision precision,
                                      const ChosenDevice& device, int threads,
                                      const std::string& transport = "auto");

}  // namespace phyxel::app
