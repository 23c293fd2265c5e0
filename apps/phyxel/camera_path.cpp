#include "camera_path.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "phyxel/error.hpp"

namespace phyxel::app {

CameraWishes camera_wishes(const std::string& scene, const std::filesystem::path& file) {
  try {
    const RenderRequest render = parse_render(scene, file);
    return {render.view, render.up, parse_camera(scene, file)};
  } catch (const InputError&) {
    return {};
  }
}

CameraWishes with_options(CameraWishes scene, const CameraOptions& options) {
  CameraRequest& camera = scene.camera;
  if (options.view) {
    if (options.position && options.target) {
      throw InputError(
          "--view beside --position and --target, which are a direction of view; allowed: two of "
          "the three");
    }
    camera.position.reset();
    camera.target.reset();
    scene.view = *options.view;
  }
  if (options.up) scene.up = *options.up;
  if (options.position) camera.position = options.position;
  if (options.target) camera.target = options.target;
  if (options.field_of_view) camera.field_of_view = *options.field_of_view;
  if (options.orbit) camera.orbit = *options.orbit;
  if (options.follow) camera.follow = *options.follow;
  if (!camera.position || !camera.target) return scene;
  scene.view = *camera.target - *camera.position;
  if (!(norm(scene.view) > 0)) {
    throw InputError(
        fmt::format("--target {},{},{}: the place of the camera; allowed: another point",
                    camera.target->x, camera.target->y, camera.target->z));
  }
  return scene;
}

std::optional<Index> body_called(const std::string& name, const std::string& scene,
                                 const std::filesystem::path& file) {
  std::vector<std::string> names;
  std::size_t soft = 0;
  try {
    const Scene read = parse_scene(scene, file);
    for (const BodyRequest& body : read.bodies) names.push_back(body.name);
    soft = names.size();
    for (const ObstacleRequest& obstacle : read.obstacles) {
      if (obstacle.density) names.push_back(obstacle.name);
    }
  } catch (const InputError& error) {
    throw InputError(
        fmt::format("the camera follows \"{}\", but the scene in the frames cannot be read: {}; "
                    "--follow '' follows nothing",
                    name, error.what()));
  }
  const auto found = std::find(names.begin(), names.end(), name);
  const auto place = static_cast<std::size_t>(found - names.begin());
  if (place < soft) return static_cast<Index>(place);
  if (place < names.size()) return std::nullopt;
  if (names.size() > 8) {
    names.resize(8);
    names.emplace_back("...");
  }
  throw InputError(fmt::format("--follow {}: no body is called that; allowed: {}", name,
                               fmt::join(names, ", ")));
}

std::optional<Vec3d> centre_of(const FrameData& frame, Index body) {
  const bool has_bodies = frame.body.size() == frame.point.size();
  Vec3d sum;
  double count = 0;
  for (std::size_t i = 0; i < frame.point.size(); ++i) {
    if (has_bodies && frame.body[i] != body) continue;
    sum += frame.point[i];
    ++count;
  }
  if (count == 0) return std::nullopt;
  return (1 / count) * sum;
}

FollowedBody::FollowedBody(std::string name, const std::string& scene,
                           const std::filesystem::path& file, RigidPaths paths)
    : name_(std::move(name)), paths_(std::move(paths)) {
  if (!name_.empty()) body_ = body_called(name_, scene, file);
}

std::optional<Vec3d> FollowedBody::centre_in(const FrameData& frame) const {
  if (body_) return centre_of(frame, *body_);
  const std::optional<RigidState> rigid = paths_.nearest(name_, frame.time);
  return rigid ? std::optional(rigid->place) : std::nullopt;
}

void FollowedBody::add(const FrameData* surface, const FrameData* phyxels) {
  if (name_.empty()) {
    way_.emplace_back();
    return;
  }
  const FrameData* frame = phyxels != nullptr ? phyxels : surface;
  const auto centre = frame != nullptr ? centre_in(*frame) : std::nullopt;
  if (!centre && !body_) {
    throw InputError(fmt::format(
        "--follow {}: rigid.csv beside the frames lacks it; allowed: the folder of a whole run",
        name_));
  }
  if (!centre) {
    throw InputError(fmt::format(
        "--follow {}: frame {} has no point of it; allowed: a body that the frames hold", name_,
        way_.size()));
  }
  if (!start_) start_ = centre;
  way_.push_back(*centre - *start_);
}

bool needs_points(const CameraRequest& camera) {
  return !camera.position && (camera.target || camera.orbit != 0);
}

std::vector<Camera> camera_path(const CameraWishes& wishes, const CameraFit& fit,
                                const std::vector<Vec3d>& points, std::size_t pictures) {
  const CameraRequest& wanted = wishes.camera;
  Camera camera = fit.camera();
  const Vec3d middle = wanted.target.value_or(fit.middle());
  if (wanted.position) {
    camera.eye = *wanted.position;
    return turned_about(camera, wishes.up, middle, wanted.orbit, pictures);
  }
  if (!needs_points(wanted)) return std::vector<Camera>(pictures, camera);
  return orbit(camera, wishes.up, middle, points, wanted.orbit, pictures);
}

}  // namespace phyxel::app
