#include "phyxel/device.hpp"

#include <cstdio>

namespace phyxel {

std::string Device::describe() const {
  char text[256];
  std::snprintf(text, sizeof text, "%s (compute capability %d.%d, %d SMs, %.1f GB)", name.c_str(),
                major, minor, multiprocessors, static_cast<double>(memory) * 1e-9);
  return text;
}

}  // namespace phyxel
