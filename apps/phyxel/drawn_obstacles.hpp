/// The obstacles of a trajectory's scene, for pictures and pages.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel::app {

/// Obstacles of a scene.
struct DrawnObstacles {
  std::vector<Obstacle> obstacles;    ///< Those that can be drawn, without distance fields.
  std::vector<std::string> left_out;  ///< The others: a name and a reason each.
};

/// Reads the obstacles of a scene's text. Those of an equilibrium are at the ends of their paths.
/// A text that cannot be parsed, as one of another version, has none.
/// @param file of the scene, from whose folder it names meshes
/// @param refusal returns the reason why a mesh is not read; "" if it is
DrawnObstacles drawn_obstacles(
    const std::string& scene, const std::filesystem::path& file,
    const std::function<std::string(const std::filesystem::path& mesh)>& refusal);

/// A floor for the shadows of bodies in a scene without obstacles. Bodies do not touch it: it lies
/// a little below the lowest place that they reach.
/// @param up not zero @param middle of the bodies [m]
/// @param lowest smallest coordinate of the bodies along `up`, a unit vector, over all frames [m]
/// @param extent of the bodies [m]
Obstacle floor_below(Vec3d up, Vec3d middle, double lowest, double extent);

/// True if a camera looks down, so that a floor does not hide bodies or shrink to a line.
bool looks_down(Vec3d view, Vec3d up);

}  // namespace phyxel::app
