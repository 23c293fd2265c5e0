#include "obstacle_rays.hpp"

#include <algorithm>
#include <cmath>

#include "phyxel/physics/obstacles.hpp"

namespace phyxel::app {
namespace {

constexpr int most_steps = 256;

/// Returns apply(gap), where gap(x) is the distance of a place from an obstacle.
template <class Apply>
auto with_gap(const PlacedObstacle& obstacle, Apply&& apply) {
  return ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
    return apply([&](Vec3d x) { return gap_to(shape, obstacle.step, x); });
  });
}

}  // namespace

double PlacedObstacle::distance(Vec3d x) const {
  return with_gap(*this, [&](const auto& gap) { return gap(x).distance; });
}

std::vector<PlacedObstacle> placed(const std::vector<Obstacle>& obstacles, const RigidPaths& paths,
                                   double time) {
  std::vector<PlacedObstacle> all;
  for (const Obstacle& obstacle : obstacles) {
    all.push_back({obstacle.form, paths.at(obstacle, time), obstacle.is_bounded(),
                   static_cast<Index>(all.size())});
  }
  return all;
}

// A ray of the cone is at most spread * t away from the middle at a distance t, so it crosses
// nothing before a distance u with (u - t) + spread * u = the distance of the surface.
double clear_distance(const PlacedObstacle& obstacle, const Cone& cone, double from,
                      double farthest) {
  return with_gap(obstacle, [&](const auto& gap) {
    double t = from;
    for (int k = 0; k < most_steps && t < farthest; ++k) {
      const double clear = std::abs(gap(cone.eye + t * cone.direction).distance);
      const double next = (clear + t) / (1 + cone.spread);
      if (!(next - t > 0.25 * cone.spread * t)) break;  // little is gained
      t = next;
    }
    return t;
  });
}

std::optional<Entry> first_entry(const PlacedObstacle& obstacle, const Cone& cone, double from,
                                 double farthest) {
  return with_gap(obstacle, [&](const auto& gap) -> std::optional<Entry> {
    double t = from, before = from, left = 0;  // place before this, and distance left there
    for (int k = 0; k < most_steps && t < farthest; ++k) {
      const Gap here = gap(cone.eye + t * cone.direction);
      const double tolerance = 0.1 * cone.spread * t, approach = -dot(here.normal, cone.direction);
      if (left > 0 && here.distance < 0) {
        return Entry{before + (t - before) * left / (left - here.distance), here.normal};
      }
      if (left > 0 && here.distance <= tolerance && approach > 0) return Entry{t, here.normal};
      if (here.distance > tolerance || (k == 0 && here.distance > 0)) left = here.distance;
      const double clear = std::abs(here.distance);
      // Close to the surface, as far as the surface is along the ray if it is flat.
      const bool close = clear <= 8 * cone.spread * t;
      before = t;
      if (close && here.distance <= 0 && approach < 0) t += cone.spread * t;  // leaves the obstacle
      t += std::max(close ? clear / std::clamp(std::abs(approach), 0.2, 1.0) : clear, tolerance);
    }
    return std::nullopt;
  });
}

}  // namespace phyxel::app
