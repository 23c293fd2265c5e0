#include "picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "drawn_obstacles.hpp"
#include "field_colours.hpp"
#include "files/atomic_file.hpp"
#include "frame_scene.hpp"
#include "phyxel/error.hpp"
#include "png_file.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// Fits the camera to all frames, so that it sees the whole motion.
Setting set_stage(const std::vector<Shot>& shots, const PictureRequest& request) {
  Setting setting;
  setting.time_decimals = time_decimals(shots);
  const Shot& first = shots.front();
  const fs::path& start = first.surface.empty() ? first.phyxels : first.surface;
  const std::string scene = scene_text(start);
  const RenderRequest asked = render_request_of(scene, start);
  setting.obstacles = obstacles_of_frames(scene, request.scene_folder);
  setting.paths = RigidPaths(start.parent_path());
  setting.up = request.up.value_or(asked.up);
  // The scene's `up` and a requested `view` may be parallel, which CameraFit handles.
  CameraFit fit(request.width, request.height, request.view.value_or(asked.view), setting.up);
  Span height;  // along `up`
  for (const Shot& shot : shots) {
    for (const fs::path& file : {shot.surface, shot.phyxels}) {
      const auto frame = read_if_any(file);
      if (!frame) continue;
      fit.include(frame->point);
      for (const Vec3d& p : frame->point) height.include(dot(p, normalised(setting.up)));
    }
  }
  for (const Obstacle& obstacle : setting.obstacles) {
    for (const auto& [time, state] : setting.paths.of(obstacle))
      fit.include(std::span(&state.place, 1));
  }
  if (fit.empty()) throw InputError("the frames have no point with finite coordinates");
  const auto phyxels = read_if_any(shots.front().phyxels);
  if (phyxels) setting.spacing = typical_spacing(phyxels->point);
  setting.camera = fit.camera();
  setting.extent = fit.extent();
  setting.middle = fit.middle();
  setting.scale_bar = true;
  setting.nearest_dots = 8;
  if (request.floor && setting.obstacles.empty() &&
      looks_down(setting.camera.forward, setting.up)) {
    setting.obstacles.push_back(
        floor_below(setting.up, setting.middle, height.low, setting.extent));
  }
  for (Obstacle& obstacle : setting.obstacles) {
    const double spacing = std::max(0.5 * setting.spacing, setting.extent / 256);
    obstacle.set_field(spacing, 4 * spacing);
  }
  return setting;
}

/// Some points of each frame, the outermost ones among them.
std::vector<Vec3d> some_points(const std::vector<Shot>& shots) {
  constexpr std::size_t most = 500;  // of a frame, beside the outermost ones
  std::vector<Vec3d> points;
  Outermost outermost;
  for (const Shot& shot : shots) {
    for (const fs::path& file : {shot.surface, shot.phyxels}) {
      const auto frame = read_if_any(file);
      if (!frame) continue;
      const std::size_t every = 1 + frame->point.size() / most;
      for (std::size_t k = 0; k < frame->point.size(); ++k) {
        outermost.include(frame->point[k]);
        if (k % every == 0) points.push_back(frame->point[k]);
      }
    }
  }
  points.insert(points.end(), outermost.points().begin(), outermost.points().end());
  return points;
}

/// The setting of some pictures, with a camera of each.
class Stage {
 public:
  /// @param chosen number of the shot of each picture
  Stage(const std::vector<Shot>& shots, const std::vector<std::size_t>& chosen,
        const PictureRequest& request)
      : shots_(shots), setting_(set_stage(shots, request)) {
    if (!request.colour.empty()) {
      setting_.colouring = field_colours(
          shots, chosen, {request.colour, request.range, request.scale}, setting_.spacing);
    }
    if (request.orbit == 0) return;
    cameras_ = orbit(setting_.camera, setting_.up, setting_.middle, some_points(shots),
                     request.orbit, chosen.size());
  }

  /// Draws a shot. @param picture number of the picture among those chosen
  Image draw(std::size_t shot, std::size_t picture) {
    if (!cameras_.empty()) setting_.camera = cameras_[picture];
    const bool fields = setting_.colouring.has_value();
    const auto surface = read_if_any(shots_[shot].surface, fields);
    const auto phyxels = read_if_any(shots_[shot].phyxels, fields || surface);
    return draw_picture(surface ? &*surface : nullptr, phyxels ? &*phyxels : nullptr, setting_);
  }

 private:
  const std::vector<Shot>& shots_;
  Setting setting_;
  std::vector<Camera> cameras_;  // of the pictures; empty if they share that of the setting
};

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
  Stage stage(trajectory.shots, chosen, request);
  make_writable_folder(folder);
  for (std::size_t k = 0; k < chosen.size(); ++k) write_png(files[k], stage.draw(chosen[k], k));
  return files;
}

std::size_t render_video(const fs::path& input, const VideoRequest& video,
                         const PictureRequest& request, bool overwrite) {
  check_video(video, request.width, request.height, overwrite);
  const Trajectory trajectory = find_trajectory(input, {request.surface, request.phyxels});
  auto chosen = choose_frames(request.choice, trajectory.shots.size());
  if (chosen.size() == 1 && request.orbit != 0) {
    constexpr int seconds = 4;
    chosen.resize(static_cast<std::size_t>(seconds * video.pictures_per_second), chosen[0]);
  }
  Stage stage(trajectory.shots, chosen, request);
  if (video.file.has_parent_path()) make_writable_folder(video.file.parent_path());
  Video film(video, request.width, request.height);
  for (std::size_t k = 0; k < chosen.size(); ++k) film.add(stage.draw(chosen[k], k));
  film.finish();
  return chosen.size();
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
