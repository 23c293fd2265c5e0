/// From the [[obstacle]] sections of a scene file to requests.
#pragma once

#include <vector>

#include "phyxel/scene.hpp"
#include "scene/scene_table.hpp"

namespace phyxel {

constexpr std::size_t most_obstacles = 1000;

/// Whether the files that a scene names have to be there.
enum class FilesOf { run, picture };

/// Reads the obstacles of a scene.
/// @param files whether their meshes have to be there
/// @throws InputError for lengths that a shape lacks or does not have, names found twice, and
///   meshes that are not there
std::vector<ObstacleRequest> read_obstacles(const SceneTable& root, FilesOf files);

/// Checks what the table of keys cannot say of an obstacle made in code or read from a file.
/// @throws InputError naming the obstacle and what is allowed
void check_obstacle(const ObstacleRequest& obstacle);

}  // namespace phyxel
