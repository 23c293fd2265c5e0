/// Fuzzer of the scene parser: any text gives a scene or an InputError.
#include <cstddef>
#include <cstdint>
#include <string>

#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    phyxel::parse_scene(std::string(reinterpret_cast<const char*>(data), size), "scene.toml");
  } catch (const phyxel::InputError&) {
  }
  return 0;
}
