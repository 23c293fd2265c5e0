#include "model/rigid_tips.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/box.hpp"

namespace phyxel {
namespace {

/// The points of a surface by which it touches others: its vertices, and points on its triangles
/// where these are large.
std::vector<Vec3d> tips_of(const Surface& surface) {
  std::vector<Vec3d> tips = surface.position;
  const Box box = box_around(surface.position);
  const double longest = norm(box.high - box.low) / 24;
  for (const Triangle& t : surface.triangle) {
    const Vec3d a = surface.position[t[0]], b = surface.position[t[1]], c = surface.position[t[2]];
    const double edge = std::max({norm(b - a), norm(c - b), norm(a - c)});
    const int parts = static_cast<int>(std::ceil(edge / longest));
    for (int i = 0; i <= parts; ++i) {
      for (int j = 0; i + j <= parts; ++j) {
        if (i == parts || j == parts || i + j == 0) continue;  // vertices
        tips.push_back(a + (i / double(parts)) * (b - a) + (j / double(parts)) * (c - a));
      }
    }
  }
  return tips;
}

}  // namespace

std::vector<std::size_t> free_bodies(const Model& model) {
  std::vector<std::size_t> bodies;
  for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
    if (model.obstacles[o].free) bodies.push_back(o);
  }
  return bodies;
}

RigidTips::RigidTips(const Model& model) : model_(model) {
  const std::vector<std::size_t> free = free_bodies(model);
  if (free.empty()) return;
  const std::size_t count = model.obstacles.size();
  tips_.resize(count);
  radius_.assign(count, 0);
  middle_.resize(count);
  inside_.resize(count);
  placed_.resize(count);
  for (std::size_t k = 0; k < free.size(); ++k) placed_[free[k]].free = static_cast<int>(k);
  for (std::size_t o = 0; o < count; ++o) {
    placed_[o].obstacle = o;
    const Obstacle& obstacle = model.obstacles[o];
    if (obstacle.hollow || !obstacle.is_bounded()) continue;
    if (obstacle.surface) {
      tips_[o] = tips_of(*obstacle.surface);
    } else {
      ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
        if constexpr (requires { shape.solid(); }) {
          shape.for_each_tip([&](Vec3d x, double radius, Vec3d core) {
            tips_[o].push_back(x);
            inside_[o].push_back(core);
            radius_[o] = radius;
          });
        }
      });
    }
    for (const Vec3d x : tips_[o]) middle_[o] += x / static_cast<double>(tips_[o].size());
    double& reach = placed_[o].reach;
    for (const Vec3d x : tips_[o]) reach = std::max(reach, norm(x - middle_[o]) + radius_[o]);
    inside_[o].resize(tips_[o].size(), middle_[o]);  // of meshes
    // Of long and flat bodies no farther than they are thick: there lie other normals.
    const double way = std::min(0.1 * reach, 0.5 * obstacle.inner_radius());
    for (std::size_t k = 0; k < tips_[o].size(); ++k) {
      const Vec3d inwards = inside_[o][k] - tips_[o][k];
      inside_[o][k] = tips_[o][k];
      if (norm(inwards) > 0) inside_[o][k] += way * normalised(inwards);
    }
  }
}

void RigidTips::place(const std::function<ObstacleStep(std::size_t obstacle)>& step_of) {
  for (Placed& here : placed_) {
    here.step = step_of(here.obstacle);
    here.centre = here.step.turn * middle_[here.obstacle] + here.step.place;
  }
}

std::string rigid_overlap_at_start(const Model& model, const Scene& scene) {
  RigidTips tips(model);
  tips.place([&](std::size_t o) {
    const Obstacle& obstacle = model.obstacles[o];
    return obstacle.free ? obstacle.placed(obstacle.start) : obstacle.step_from(0, 0);
  });
  double depth = 0;
  std::size_t first = 0, second = 0;
  tips.for_each_inside(
      [&](const RigidTips::Placed& of_tips, const RigidTips::Placed& other, Vec3d, const Gap& gap) {
        if (!(-gap.distance > depth)) return;
        depth = -gap.distance;
        first = of_tips.obstacle;
        second = other.obstacle;
      });
  constexpr double rounding = 1e-9;  // of places
  const Obstacle *a = &model.obstacles[first], *b = &model.obstacles[second];
  if (!(depth > rounding * (norm(a->place) + norm(b->place)))) return {};
  const std::string& where = scene.obstacles[first].where;
  return fmt::format(
      "{}{}obstacle \"{}\" is {:.3g} m deep in obstacle \"{}\" at the start, and one of them is a "
      "free body; allowed: to touch it",
      where, where.empty() ? "" : ": ", a->name, depth, b->name);
}

}  // namespace phyxel
