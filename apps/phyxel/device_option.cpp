#include "device_option.hpp"

#include <fmt/format.h>

#include "program_ranks.hpp"
#include "terminal.hpp"

namespace phyxel::app {

ChosenDevice choose_device(const std::string& name, const std::string& where) {
  ChosenDevice chosen = phyxel::choose_device(all_ranks(), name, where);
  if (name == "auto" && !chosen.gpu && all_ranks().leads() && !cuda_devices().empty()) {
    fmt::print(stderr, "phyxel: {}the GPU is not used: {}\n", warning_word(), chosen.why_no_gpu);
  }
  return chosen;
}

Facts device_facts(const ChosenDevice& device) {
  return device.gpu ? Facts{{"gpu", device.gpu->describe()}, {"cuda", cuda_version()}} : Facts{};
}

}  // namespace phyxel::app
