/// The obstacles of a scene's text.
#pragma once

#include "phyxel/scene.hpp"

namespace phyxel {

/// The part of a scene that places its obstacles: those, and the solver; whatever its bodies are.
/// Files that it names may be gone. @throws InputError as `parse_scene`
Scene parse_obstacles(const std::string& text, const std::filesystem::path& file);

}  // namespace phyxel
