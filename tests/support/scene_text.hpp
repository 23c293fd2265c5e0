/// Pieces of scene files, and the messages about them.
#pragma once

#include <filesystem>
#include <string>

#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"
#include "support/folder.hpp"

namespace phyxel {

namespace fs = std::filesystem;

using test::text_of;

inline std::string message_of(const std::string& text, const fs::path& file = "scene.toml") {
  try {
    parse_scene(text, file);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

class SceneFiles : public test::Folder {};

inline const std::string time_section = "[time]\nend = 1\n";  // 2 lines
inline const std::string beam =
    "[[body]]\nshape = 'beam'\nsize = [1, 1, 1]\nspacing = 0.1\n";  // 4 lines
inline const std::string material = "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n";
inline const std::string dino = "[[body]]\nshape = 'dino'\n" + material;  // 6 lines

}  // namespace phyxel
