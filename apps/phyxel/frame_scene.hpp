/// The scene whose text a frame carries, as pictures and exports use it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// The text of the scene in a frame; empty if the frame cannot be read.
std::string scene_text(const std::filesystem::path& file);

/// The requests for pictures in a scene's text; the defaults if the text cannot be parsed.
/// @param file of the text, for messages
RenderRequest render_request_of(const std::string& scene, const std::filesystem::path& file);

/// The obstacles of a scene. A warning on stderr names those whose meshes are missing.
/// @param folder from which the scene names meshes; empty: the current one
std::vector<Obstacle> obstacles_of_frames(const std::string& scene,
                                          const std::filesystem::path& folder);

}  // namespace phyxel::app
