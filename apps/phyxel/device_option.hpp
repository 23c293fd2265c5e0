/// The option --device.
#pragma once

#include <string>

#include "csv.hpp"
#include "device.hpp"
#include "phyxel/device.hpp"

namespace phyxel::app {

inline constexpr const char* device_help = "Device: auto, cpu, cuda or cuda:<number>";

/// Chooses the device of this program's ranks; warns on stderr if "auto" finds a GPU that it cannot
/// use. Collective. @throws as `phyxel::choose_device`
ChosenDevice choose_device(const std::string& name, const std::string& where = "--device");

/// Facts about the device for tables of measurements; empty for the CPU.
Facts device_facts(const ChosenDevice& device);

}  // namespace phyxel::app
