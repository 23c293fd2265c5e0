#include "frame_scene.hpp"

#include <fmt/format.h>

#include "drawn_obstacles.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"
#include "terminal.hpp"

namespace phyxel::app {

namespace fs = std::filesystem;

std::string scene_text(const fs::path& file) {
  try {
    return read_frame(file, true).scene;
  } catch (const InputError&) {
    return {};
  }
}

RenderRequest render_request_of(const std::string& scene, const fs::path& file) {
  try {
    return parse_render(scene, file);
  } catch (const InputError&) {
    return {};  // the frame has no scene text, or one of another version
  }
}

std::vector<Obstacle> obstacles_of_frames(const std::string& scene, const fs::path& folder) {
  DrawnObstacles drawn =
      drawn_obstacles(scene, folder / "scene.toml", [](const fs::path& mesh) -> std::string {
        if (fs::exists(mesh)) return "";
        return fmt::format("there is no {}; --scene-folder names the scene's folder",
                           mesh.string());
      });
  for (const std::string& line : drawn.left_out) {
    fmt::print(stderr, "phyxel: {}{}\n", warning_word(), line);
  }
  return std::move(drawn.obstacles);
}

}  // namespace phyxel::app
