/// The obstacles of a replay as its page stores them.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "drawn_obstacles.hpp"
#include "report/replay_data.hpp"
#include "rigid_paths.hpp"

namespace phyxel::app {

/// Shapes, lengths and places of obstacles, in units of the radius of `extent`, about its centre.
/// A place is a rotation, row by row, and a translation; there is one for each time, or a single
/// one of an obstacle at rest. The surface of a mesh is in the elements `obstacle<k>` (vertices,
/// float) and `obstacle<k>-triangles`.
/// @param paths of those that are free bodies. @param times of the frames [s]
nlohmann::ordered_json obstacles_json(const std::vector<Obstacle>& obstacles,
                                      const RigidPaths& paths, std::span<const double> times,
                                      const Extent& extent);

/// Size of the elements with surfaces of obstacles [bytes].
double embedded_size(const std::vector<Obstacle>& obstacles);

/// The elements of a page that hold the surfaces of obstacles from meshes.
std::string obstacle_elements(const std::vector<Obstacle>& obstacles, const Extent& extent);

/// A floor below all points of a scene without obstacles.
/// @param gap distance to the lowest point [m]
Obstacle floor_under(const std::vector<Instance>& instances, const Extent& extent, Vec3d up,
                     double gap = 0);

}  // namespace phyxel::app
