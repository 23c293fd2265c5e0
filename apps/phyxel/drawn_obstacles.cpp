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

}  // namespace phyxel::app
