#include "picture.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "drawn_obstacles.hpp"
#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"
#include "png_file.hpp"
#include "sort_unique.hpp"
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

/// The wishes for pictures in a scene's text; the defaults if it cannot be parsed.
RenderRequest wishes_in(const std::string& scene, const fs::path& file) {
  try {
    return parse_render(scene, file);
  } catch (const InputError&) {
    return {};  // the frame has no scene text, or one of another version
  }
}

/// The obstacles of a scene; a warning names those whose meshes are gone.
std::vector<Obstacle> obstacles_in(const std::string& scene, const fs::path& folder) {
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

/// Fits the camera to all frames, so that it sees the whole motion.
Setting set_stage(const std::vector<Shot>& shots, const PictureRequest& request) {
  Setting setting;
  setting.time_decimals = time_decimals(shots);
  const Shot& first = shots.front();
  const fs::path& start = first.surface.empty() ? first.phyxels : first.surface;
  const std::string scene = scene_text(start);
  const RenderRequest asked = wishes_in(scene, start);
  setting.obstacles = obstacles_in(scene, request.scene_folder);
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

/// The colours that show a field of the frames.
/// @throws InputError if the frames lack it
Colouring colouring_of(const std::vector<Shot>& shots, const std::vector<std::size_t>& chosen,
                       const PictureRequest& request, double spacing) {
  Colouring colouring{.field = request.colour};
  const auto surface = read_if_any(shots.front().surface, true),
             phyxels = read_if_any(shots.front().phyxels, true);
  if (surface && phyxels && !surface->point.empty() && !phyxels->point.empty()) {
    colouring.carriers =
        carriers_of(surface->point, phyxels->point, spacing > 0 ? 1.6 * spacing : 1);
  }
  const auto shown = [&](const std::optional<FrameData>& a, const std::optional<FrameData>& b) {
    return shown_values(a ? &*a : nullptr, b ? &*b : nullptr, colouring);
  };
  if (shown(surface, phyxels).empty()) {
    std::vector<std::string> names;
    for (const auto& frame : {surface, phyxels}) {
      if (!frame) continue;
      for (const std::string& name : colour_fields(*frame)) names.push_back(name);
    }
    sort_unique(names);
    throw InputError(fmt::format(
        "--colour {}: the frames have no such number or vector; allowed: {}; "
        "output.fields of the scene adds others",
        request.colour, names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
  }
  if (request.range) {
    const auto [low, high] = *request.range;
    colouring.range = {low, high, request.scale == Scale::logarithmic};
    return colouring;
  }
  constexpr std::size_t most = 1'000'000;  // values of a sample
  std::vector<double> sample;
  for (const std::size_t k : chosen) {
    const std::vector<double> values =
        shown(read_if_any(shots[k].surface, true), read_if_any(shots[k].phyxels, true));
    const std::size_t every = 1 + values.size() * chosen.size() / most;
    for (std::size_t i = 0; i < values.size(); i += every) {
      if (std::isfinite(values[i])) sample.push_back(values[i]);
    }
  }
  colouring.range = colour_range(std::move(sample), request.scale);
  return colouring;
}

/// The setting of some pictures, with a camera of each.
class Stage {
 public:
  /// @param chosen number of the shot of each picture
  Stage(const std::vector<Shot>& shots, const std::vector<std::size_t>& chosen,
        const PictureRequest& request)
      : shots_(shots), setting_(set_stage(shots, request)) {
    if (!request.colour.empty()) {
      setting_.colouring = colouring_of(shots, chosen, request, setting_.spacing);
    }
    if (request.orbit == 0) return;
    cameras_ = orbit(setting_.camera, setting_.up, setting_.middle, some_points(shots),
                     request.orbit, chosen.size());
  }

  /// Draws a shot. @param picture number of the picture among those chosen
  Image draw(std::size_t shot, std::size_t picture) {
    if (!cameras_.empty()) setting_.camera = cameras_[picture];
    const bool fields = setting_.colouring.has_value();
    const auto surface = read_if_any(shots_[shot].surface, fields),
               phyxels = read_if_any(shots_[shot].phyxels, fields);
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
