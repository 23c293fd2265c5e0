#include "shadow.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace phyxel::app {
namespace {

constexpr int texels = 1024;
constexpr double slant_left = 0.42, slant_to_viewer = 0.24;  // tangents
constexpr float softness = 0.16f;         // diameter of the light over its distance
constexpr float widest = 0.12f * texels;  // radius of the widest edge [texels]
constexpr int search_taps = 24, edge_taps = 40;

/// Points spread evenly over a disc of radius 1: Vogel's spiral.
template <int n>
std::array<Vec3<float>, n> spread_points() {
  std::array<Vec3<float>, n> points;
  for (int k = 0; k < n; ++k) {
    const double r = std::sqrt((k + 0.5) / n), angle = 2.39996322972865332 * k;
    points[k] = to<float>(Vec3d{r * std::cos(angle), r * std::sin(angle), 0});
  }
  return points;
}

}  // namespace

Vec3d light_direction(const Camera& camera, Vec3d up) {
  const Vec3d u = normalised(up);
  const Vec3d back = -camera.forward, level = normalised(back - dot(back, u) * u);
  return normalised(u - slant_left * camera.right + slant_to_viewer * level);
}

ShadowBounds::ShadowBounds(const Camera& camera, Vec3d light) : light_(light) {
  const Vec3d across = cross(light, camera.right);
  // The light never comes along the camera's right axis, from which it is slanted but little.
  up_ = normalised(across);
  right_ = cross(up_, light);
  low_.fill(std::numeric_limits<double>::infinity());
  high_.fill(-std::numeric_limits<double>::infinity());
}

void ShadowBounds::include(std::span<const Vec3d> points) {
  for (const Vec3d& p : points) {
    if (!std::isfinite(p.x + p.y + p.z)) continue;
    for (const int k : {0, 1}) include(k, dot(p, axis(k)), dot(p, axis(k)));
  }
}

void ShadowBounds::include(int axis, double low, double high) {
  const auto k = static_cast<std::size_t>(axis);
  low_[k] = std::min(low_[k], low);
  high_[k] = std::max(high_[k], high);
}

Camera ShadowBounds::camera(Vec3d middle, double reach) const {
  const double distance = 100 * reach;
  const double size = std::max(high_[0] - low_[0], high_[1] - low_[1]);
  Camera camera{texels, texels, {}, right_, up_, -light_};
  camera.eye = (0.5 * (low_[0] + high_[0])) * right_ + (0.5 * (low_[1] + high_[1])) * up_ +
               (dot(middle, light_) + distance) * light_;
  camera.focal = 0.96 * texels * distance / size;
  return camera;
}

Shadows::Shadows(const Rasteriser& seen)
    : camera_(seen.camera()), nearest_(std::numeric_limits<float>::infinity()) {
  for (int y = 0; y < texels; ++y) {
    for (int x = 0; x < texels; ++x) {
      const float nearness = seen.nearness(x, y);
      depth_.push_back(nearness > 0 ? 1 / nearness : 0);
      body_.push_back(seen.body(x, y));
      if (nearness > 0) nearest_ = std::min(nearest_, depth_.back());
    }
  }
}

float Shadows::in_front(int x, int y, float depth, Index body) const {
  if (x < 0 || y < 0 || x >= texels || y >= texels) return 0;
  const auto s = static_cast<std::size_t>(y) * texels + static_cast<std::size_t>(x);
  return depth_[s] < depth && body_[s] != body ? depth_[s] : 0;
}

float Shadows::light_at(Vec3d place, Index body) const {
  static const auto search = spread_points<search_taps>();
  static const auto edge = spread_points<edge_taps>();
  const Camera::Place at = camera_.project(place);
  const auto x = static_cast<float>(at.x), y = static_cast<float>(at.y);
  const auto depth = static_cast<float>(at.depth),
             per_length = static_cast<float>(camera_.focal / at.depth);
  if (!(depth > nearest_)) return 1;
  const auto radius_at = [&](float blocker) {
    return std::clamp(0.5f * softness * (depth - blocker) * per_length, 1.0f, widest);
  };
  const float reach = radius_at(nearest_);
  if (!(x > -reach && y > -reach && x < texels + reach && y < texels + reach)) return 1;
  const float bias = depth - 2 / per_length;
  float sum = 0;
  int found = 0;
  for (const Vec3<float>& tap : search) {
    const float blocker = in_front(static_cast<int>(std::floor(x + reach * tap.x)),
                                   static_cast<int>(std::floor(y + reach * tap.y)), bias, body);
    sum += blocker;
    found += blocker > 0;
  }
  if (found == 0) return 1;
  const float radius = radius_at(sum / static_cast<float>(found));
  float dark = 0;
  for (const Vec3<float>& tap : edge) {
    const float u = x + radius * tap.x - 0.5f, v = y + radius * tap.y - 0.5f;
    const float fu = std::floor(u), fv = std::floor(v), a = u - fu, b = v - fv;
    const int i = static_cast<int>(fu), j = static_cast<int>(fv);
    const auto blocked = [&](int k, int l) { return in_front(k, l, bias, body) > 0 ? 1.0f : 0.0f; };
    dark += (1 - b) * ((1 - a) * blocked(i, j) + a * blocked(i + 1, j)) +
            b * ((1 - a) * blocked(i, j + 1) + a * blocked(i + 1, j + 1));
  }
  return 1 - dark / edge_taps;
}

}  // namespace phyxel::app
