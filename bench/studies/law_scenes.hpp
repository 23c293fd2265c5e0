/// First scenes, as somebody who is new to phyxel makes them: soft bodies of common shapes under
/// gravity, and bodies that are pressed, pulled, twisted and thrown. The law is left open.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "phyxel/scene.hpp"

namespace phyxel::studies {

/// A scene of one body without a law.
struct FirstScene {
  std::string name;
  std::string what;  ///< One sentence for the page.
  Scene scene;
  Vec3d (*start)(Vec3d) = nullptr;  ///< Displacements at t = 0 [m]; null: none.
};

/// Scenes of built-in shapes, and those of the meshes that stand on and hang from a tenth of their
/// height, one metre high, at three stiffnesses.
/// @throws InputError for a mesh that cannot be read or filled
std::vector<FirstScene> first_scenes(const std::vector<std::filesystem::path>& meshes);

}  // namespace phyxel::studies
