/// The device that a command runs on: what --device says, or what there is.
#pragma once

#include <string>

#include "csv.hpp"
#include "device.hpp"
#include "phyxel/device.hpp"

namespace phyxel::app {

inline constexpr const char* device_help = "auto, cpu, cuda or cuda:<number>";

/// The library's, of this program's ranks; says on stderr if there are GPUs that "auto" cannot use.
/// Collective.
ChosenDevice choose_device(const std::string& name, const std::string& where = "--device");

/// What measurements on it are labelled with; nothing for the CPU.
Facts device_facts(const ChosenDevice& device);

}  // namespace phyxel::app
