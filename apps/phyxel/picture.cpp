#include "picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "files/atomic_file.hpp"
#include "model/contact.hpp"
#include "phyxel/error.hpp"
#include "png_file.hpp"
#include "scene/parse_obstacles.hpp"
#include "terminal.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// The text of the scene in a frame; empty if there is none.
std::string scene_text(const fs::path& file) {
  try {
    return read_frame(file, true).scene;
  } catch (const InputError&) {
    return {};
  }
}

/// What a scene's text says, as `parse` reads it; `otherwise` if it cannot be parsed.
template <class Parse, class Said>
Said said(const std::string& scene, const fs::path& file, const Parse& parse, Said otherwise) {
  try {
    return parse(scene, file);
  } catch (const InputError&) {
    return otherwise;  // the frame has no scene text, or one of another version
  }
}

/// The obstacles of a scene, but for those whose meshes are gone. An equilibrium has them at the
/// ends of their paths.
std::vector<Obstacle> obstacles_in(Scene scene) {
  std::erase_if(scene.obstacles, [](const ObstacleRequest& obstacle) {
    if (obstacle.mesh.empty() || fs::exists(obstacle.mesh)) return false;
    fmt::print(
        stderr,
        "phyxel: {}obstacle \"{}\" is not in the pictures: there is no {}; --scene-folder names "
        "the scene's folder\n",
        warning_word(), obstacle.name, obstacle.mesh.string());
    return true;
  });
  std::vector<Obstacle> obstacles = obstacles_of(scene);
  if (scene.solver.method != Method::equilibrium) return obstacles;
  for (Obstacle& obstacle : obstacles) obstacle.motion.duration = 0;
  return obstacles;
}

/// Fits the camera to all frames, so that it sees the whole motion.
Setting set_stage(const std::vector<Shot>& shots, const PictureRequest& request) {
  Setting setting;
  setting.time_decimals = time_decimals(shots);
  const Shot& first = shots.front();
  const fs::path& start = first.surface.empty() ? first.phyxels : first.surface;
  const std::string scene = scene_text(start);
  const RenderRequest asked = said(scene, start, parse_render, RenderRequest{});
  setting.obstacles =
      obstacles_in(said(scene, request.scene_folder / "scene.toml", parse_obstacles, Scene{}));
  setting.up = request.up.value_or(asked.up);
  // The scene's `up` and a requested `view` may be parallel, which CameraFit handles.
  CameraFit fit(request.width, request.height, request.view.value_or(asked.view), setting.up);
  for (const Shot& shot : shots) {
    for (const fs::path& file : {shot.surface, shot.phyxels}) {
      if (const auto frame = read_if_any(file)) fit.include(frame->point);
    }
  }
  if (fit.empty()) throw InputError("the frames have no point with finite coordinates");
  const auto phyxels = read_if_any(shots.front().phyxels);
  if (phyxels) setting.spacing = typical_spacing(phyxels->point);
  setting.camera = fit.camera();
  setting.extent = fit.extent();
  setting.middle = fit.middle();
  for (Obstacle& obstacle : setting.obstacles) {
    const double spacing = std::max(0.5 * setting.spacing, setting.extent / 256);
    obstacle.set_field(spacing, 4 * spacing);
  }
  return setting;
}

bool is_picture_name(const std::string& name) {
  if (name.rfind("frame_", 0) != 0 || !name.ends_with(".png") || name.size() < 16) return false;
  const std::string number = name.substr(6, name.size() - 10);
  return std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

std::vector<fs::path> render(const fs::path& input, const fs::path& folder,
                             const PictureRequest& request, bool overwrite) {
  const Trajectory trajectory = find_trajectory(input, {request.surface, request.phyxels});
  const auto chosen = choose_frames(request.choice, trajectory.shots.size());
  std::vector<fs::path> files;
  for (const std::size_t k : chosen) {
    files.push_back(folder / (trajectory.series ? fmt::format("frame_{:06d}.png", k)
                                                : input.stem().string() + ".png"));
    check_output_file(files.back(), overwrite, Output::file);
  }
  const Setting setting = set_stage(trajectory.shots, request);
  make_writable_folder(folder);
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const Shot& shot = trajectory.shots[chosen[k]];
    const auto surface = read_if_any(shot.surface), phyxels = read_if_any(shot.phyxels);
    write_png(files[k],
              draw_picture(surface ? &*surface : nullptr, phyxels ? &*phyxels : nullptr, setting));
  }
  return files;
}

std::vector<fs::path> render_directory(const fs::path& out, const Scene& scene, bool overwrite) {
  const RenderRequest& request = scene.render;
  PictureRequest pictures;
  pictures.scene_folder = scene.file.parent_path();
  pictures.width = request.width;
  pictures.height = request.height;
  pictures.view = request.view;
  pictures.up = request.up;
  pictures.choice.count = request.count;
  const fs::path folder = out / "pictures";
  if (overwrite && fs::is_directory(folder)) {
    std::vector<fs::path> stale;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (is_picture_name(entry.path().filename().string())) stale.push_back(entry.path());
    }
    for (const fs::path& file : stale) fs::remove(file);
  }
  return render(out, folder, pictures, overwrite);
}

}  // namespace phyxel::app
