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

/// The wishes for the pictures of a trajectory, with the options of the request in their place.
CameraWishes wishes_for(const std::vector<Shot>& shots, const PictureRequest& request) {
  const Shot& first = shots.front();
  const fs::path& start = first.surface.empty() ? first.phyxels : first.surface;
  return with_options(camera_wishes(scene_text(start), start), request.camera);
}

/// Some points of a frame, and the outermost ones of all.
class SomePoints {
 public:
  void add(const std::vector<Vec3d>& points, Vec3d way) {
    constexpr std::size_t most = 500;  // of a frame, beside the outermost ones
    const std::size_t every = 1 + points.size() / most;
    for (std::size_t k = 0; k < points.size(); ++k) {
      outermost_.include(points[k] - way);
      if (k % every == 0) points_.push_back(points[k] - way);
    }
  }
  /// All points that were kept.
  std::vector<Vec3d> points() const {
    std::vector<Vec3d> all = points_;
    all.insert(all.end(), outermost_.points().begin(), outermost_.points().end());
    return all;
  }

 private:
  std::vector<Vec3d> points_;
  Outermost outermost_;
};

/// The setting of some pictures, with a camera of each.
class Stage {
 public:
  /// @param chosen number of the shot of each picture
  Stage(const std::vector<Shot>& shots, const std::vector<std::size_t>& chosen,
        const PictureRequest& request, const CameraWishes& wishes)
      : shots_(shots),
        chosen_(chosen),
        fit_(request.width, request.height, wishes.view, wishes.up, wishes.camera.field_of_view) {
    const fs::path& start =
        shots.front().surface.empty() ? shots.front().phyxels : shots.front().surface;
    const std::string scene = scene_text(start);
    followed_.emplace(wishes.camera.follow, scene, request.scene_folder / "scene.toml",
                      RigidPaths(start.parent_path()));
    setting_.time_decimals = time_decimals(shots);
    setting_.up = wishes.up;
    setting_.obstacles = obstacles_of_frames(scene, request.scene_folder);
    setting_.paths = RigidPaths(start.parent_path());
    read_frames();
    place_cameras(wishes);
    if (request.floor) add_floor();
    for (Obstacle& obstacle : setting_.obstacles) {
      const double spacing = std::max(0.5 * setting_.spacing, setting_.extent / 256);
      obstacle.set_field(spacing, 4 * spacing);
    }
    if (!request.cut.empty()) cut_ = cut_plane(request.cut, cameras_.front().eye);
    if (!request.colour.empty()) {
      setting_.colouring =
          field_colours(shots, chosen, {request.colour, request.range, request.scale, request.cut},
                        setting_.spacing);
    }
  }

  /// Draws a picture. @param picture its number among those chosen
  Image draw(std::size_t picture) {
    const std::size_t shot = chosen_[picture];
    const Vec3d way = followed_->way(shot);
    setting_.camera = cameras_[picture];
    setting_.camera.eye += way;
    setting_.middle = fit_.middle() + way;
    if (cut_) setting_.cut = CutPlane{cut_->point + way, cut_->normal};
    const bool fields = setting_.colouring.has_value();
    const auto surface = read_if_any(shots_[shot].surface, fields);
    const auto phyxels = read_if_any(shots_[shot].phyxels, fields || surface);
    return draw_picture(surface ? &*surface : nullptr, phyxels ? &*phyxels : nullptr, setting_);
  }

 private:
  /// Reads all frames, so that the camera sees the whole motion.
  void read_frames() {
    for (std::size_t k = 0; k < shots_.size(); ++k) {
      const auto surface = read_if_any(shots_[k].surface), phyxels = read_if_any(shots_[k].phyxels);
      followed_->add(surface ? &*surface : nullptr, phyxels ? &*phyxels : nullptr);
      if (k == 0 && phyxels) setting_.spacing = typical_spacing(phyxels->point);
      for (const auto* frame : {&surface, &phyxels}) {
        if (!*frame) continue;
        fit_.include((*frame)->point, followed_->way(k));
        some_.add((*frame)->point, followed_->way(k));
        for (const Vec3d& p : (*frame)->point) height_.include(dot(p, normalised(setting_.up)));
      }
    }
    for (const Obstacle& obstacle : setting_.obstacles) {
      for (const auto& [time, state] : setting_.paths.of(obstacle)) {
        fit_.include(std::span(&state.place, 1));
      }
    }
    if (fit_.empty()) throw InputError("the frames have no point with finite coordinates");
  }

  void place_cameras(const CameraWishes& wishes) {
    cameras_ = camera_path(wishes, fit_, some_.points(), chosen_.size());
    setting_.camera = cameras_.front();
    setting_.extent = fit_.extent();
    setting_.middle = fit_.middle();
    setting_.scale_bar = true;
    setting_.nearest_dots = 8;
  }

  void add_floor() {
    if (!setting_.obstacles.empty() || !looks_down(setting_.camera.forward, setting_.up)) return;
    setting_.obstacles.push_back(
        floor_below(setting_.up, setting_.middle, height_.low, setting_.extent));
  }

  const std::vector<Shot>& shots_;
  const std::vector<std::size_t>& chosen_;
  CameraFit fit_;
  std::optional<FollowedBody> followed_;
  SomePoints some_;
  Span height_;  // of all points along `up`
  Setting setting_;
  std::vector<Camera> cameras_;  // of the pictures, as if the followed body did not move
  std::optional<CutPlane> cut_;  // likewise
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
  Stage stage(trajectory.shots, chosen, request, wishes_for(trajectory.shots, request));
  make_writable_folder(folder);
  for (std::size_t k = 0; k < chosen.size(); ++k) write_png(files[k], stage.draw(k));
  return files;
}

std::size_t render_video(const fs::path& input, const VideoRequest& video,
                         const PictureRequest& request, bool overwrite) {
  check_video(video, request.width, request.height, overwrite);
  const Trajectory trajectory = find_trajectory(input, {request.surface, request.phyxels});
  auto chosen = choose_frames(request.choice, trajectory.shots.size());
  const CameraWishes wishes = wishes_for(trajectory.shots, request);
  if (chosen.size() == 1 && wishes.camera.orbit != 0) {
    constexpr int seconds = 4;
    chosen.resize(static_cast<std::size_t>(seconds * video.pictures_per_second), chosen[0]);
  }
  Stage stage(trajectory.shots, chosen, request, wishes);
  if (video.file.has_parent_path()) make_writable_folder(video.file.parent_path());
  Video film(video, request.width, request.height);
  for (std::size_t k = 0; k < chosen.size(); ++k) film.add(stage.draw(k));
  film.finish();
  return chosen.size();
}

std::vector<fs::path> render_directory(const fs::path& out, const Scene& scene, bool overwrite) {
  const RenderRequest& request = scene.render;
  PictureRequest pictures;
  pictures.scene_folder = scene.file.parent_path();
  pictures.width = request.width;
  pictures.height = request.height;
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
