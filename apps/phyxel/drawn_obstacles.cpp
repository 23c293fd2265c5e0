#include "drawn_obstacles.hpp"

#include <fmt/format.h>

#include "model/contact.hpp"
#include "phyxel/error.hpp"
#include "scene/parse_obstacles.hpp"

namespace phyxel::app {

DrawnObstacles drawn_obstacles(
    const std::string& text, const std::filesystem::path& file,
    const std::function<std::string(const std::filesystem::path& mesh)>& refusal) {
  DrawnObstacles drawn;
  Scene scene;
  try {
    scene = parse_obstacles(text, file);
  } catch (const InputError&) {
    return drawn;
  }
  std::erase_if(scene.obstacles, [&](const ObstacleRequest& obstacle) {
    if (obstacle.mesh.empty()) return false;
    const std::string why = refusal(obstacle.mesh);
    if (why.empty()) return false;
    drawn.left_out.push_back(fmt::format("obstacle \"{}\" is left out: {}", obstacle.name, why));
    return true;
  });
  drawn.obstacles = obstacles_of(scene);
  if (scene.solver.method == Method::equilibrium) {
    for (Obstacle& obstacle : drawn.obstacles) obstacle.motion.duration = 0;
  }
  return drawn;
}

Obstacle floor_below(Vec3d up, Vec3d middle, double lowest, double extent) {
  constexpr double gap = 0.05;  // over the extent
  const Vec3d normal = normalised(up);
  ObstacleRequest floor;
  floor.name = "floor";
  floor.shape = "plane";
  floor.normal = normal;
  floor.translation = middle + (lowest - gap * extent - dot(middle, normal)) * normal;
  Scene scene;
  scene.obstacles.push_back(floor);
  return obstacles_of(scene).front();
}

bool looks_down(Vec3d view, Vec3d up) { return dot(normalised(view), normalised(up)) < -0.1; }

}  // namespace phyxel::app
