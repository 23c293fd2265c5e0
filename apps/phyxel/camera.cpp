#include "camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

constexpr double filled = 0.86;  // largest share of the image that the points take along each side

constexpr double radians(double degrees) { return degrees * std::numbers::pi / 180; }

}  // namespace

Camera::Place Camera::project(Vec3d point) const {
  const Vec3d d = point - eye;
  const double depth = dot(d, forward);
  return {0.5 * width + focal * dot(d, right) / depth, 0.5 * height - focal * dot(d, up) / depth,
          depth};
}

CameraFit::CameraFit(int width, int height, Vec3d view, Vec3d up, double field_of_view) {
  if (std::min(width, height) < 16 || std::max(width, height) > 16384) {
    throw InputError(fmt::format("picture of {} x {} pixels: allowed from 16 x 16 to 16384 x 16384",
                                 width, height));
  }
  if (!is_finite(view) || !(norm(view) > 0) || !is_finite(up)) {
    throw InputError(fmt::format(
        "view [{}, {}, {}] with up [{}, {}, {}]: allowed are finite vectors, view not zero", view.x,
        view.y, view.z, up.x, up.y, up.z));
  }
  if (!(field_of_view >= 1 && field_of_view <= 150)) {
    throw InputError(fmt::format("field of view {} degrees: allowed from 1 to 150", field_of_view));
  }
  camera_.width = width;
  camera_.height = height;
  camera_.forward = normalised(view);
  for (const Vec3d candidate : {normalised(up), Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    const Vec3d right = cross(camera_.forward, candidate);
    if (norm(right) < 1e-6) continue;
    camera_.right = normalised(right);
    break;
  }
  camera_.up = cross(camera_.right, camera_.forward);
  camera_.focal = 0.5 * std::min(width, height) / std::tan(0.5 * radians(field_of_view));
  slope_x_ = filled * 0.5 * width / camera_.focal;
  slope_y_ = filled * 0.5 * height / camera_.focal;
}

// A point (x, y, z) in the camera's axes is visible from an eye at e if |x - e_x| <= s_x (z - e_z),
// and likewise for y. Each point gives four half-spaces for the eye; the tightest are kept.
void CameraFit::include(std::span<const Vec3d> points, Vec3d way) {
  for (const Vec3d& point : points) {
    const Vec3d p = point - way;
    if (!is_finite(p)) continue;
    const double x = dot(p, camera_.right), y = dot(p, camera_.up), z = dot(p, camera_.forward);
    left_ = std::max(left_, x - slope_x_ * z);
    right_ = std::min(right_, x + slope_x_ * z);
    below_ = std::max(below_, y - slope_y_ * z);
    above_ = std::min(above_, y + slope_y_ * z);
    nearest_ = std::min(nearest_, z);
    farthest_ = std::max(farthest_, z);
    low_x_ = std::min(low_x_, x);
    high_x_ = std::max(high_x_, x);
    low_y_ = std::min(low_y_, y);
    high_y_ = std::max(high_y_, y);
  }
}

double CameraFit::extent() const {
  return empty() ? 0 : std::max({high_x_ - low_x_, high_y_ - low_y_, farthest_ - nearest_});
}

Vec3d CameraFit::middle() const {
  if (empty()) return {};
  return 0.5 * ((low_x_ + high_x_) * camera_.right + (low_y_ + high_y_) * camera_.up +
                (nearest_ + farthest_) * camera_.forward);
}

Camera CameraFit::camera() const {
  Camera fitted = camera_;
  if (empty()) return fitted;
  // The distance is at least half the extent, or the camera would touch a body seen along its axis,
  // and above the resolution of coordinates far from the origin; a single point is seen from afar.
  const double magnitude =
      std::max({std::abs(low_x_), std::abs(high_x_), std::abs(low_y_), std::abs(high_y_),
                std::abs(nearest_), std::abs(farthest_), 1e-9});
  const double clearance = std::max(0.5 * extent(), (extent() > 0 ? 1e-9 : 1e-3) * magnitude);
  const double z = std::min({(right_ - left_) / (2 * slope_x_), (above_ - below_) / (2 * slope_y_),
                             nearest_ - clearance});
  fitted.eye = 0.5 * (left_ + right_) * camera_.right + 0.5 * (below_ + above_) * camera_.up +
               z * camera_.forward;
  return fitted;
}

std::vector<Camera> turned_about(const Camera& start, Vec3d up, Vec3d middle, double degrees,
                                 std::size_t count) {
  const Vec3d axis = norm(up) > 0 ? normalised(up) : start.up;
  std::vector<Camera> cameras(count, start);
  for (std::size_t k = 1; k < count; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(count - 1);
    const double angle = share * radians(degrees);
    const auto turned = [&](Vec3d v) {  // Rodrigues' formula
      return std::cos(angle) * v + std::sin(angle) * cross(axis, v) +
             (1 - std::cos(angle)) * dot(axis, v) * axis;
    };
    Camera& camera = cameras[k];
    camera.right = turned(start.right);
    camera.up = turned(start.up);
    camera.forward = turned(start.forward);
    camera.eye = middle + turned(start.eye - middle);
  }
  return cameras;
}

std::vector<Camera> orbit(const Camera& start, Vec3d up, Vec3d middle,
                          std::span<const Vec3d> points, double degrees, std::size_t count) {
  const double slope_x = filled * 0.5 * start.width / start.focal,
               slope_y = filled * 0.5 * start.height / start.focal;
  std::vector<Camera> cameras = turned_about(start, up, middle, degrees, count);
  double distance = 0;
  for (const Camera& camera : cameras) {
    for (const Vec3d& point : points) {
      const Vec3d d = point - middle;
      if (!is_finite(d)) continue;
      const double z = dot(d, camera.forward);
      distance = std::max({distance, std::abs(dot(d, camera.right)) / slope_x - z,
                           std::abs(dot(d, camera.up)) / slope_y - z});
    }
  }
  if (!(distance > 0)) distance = norm(start.eye - middle);
  for (Camera& camera : cameras) camera.eye = middle - distance * camera.forward;
  return cameras;
}

}  // namespace phyxel::app
