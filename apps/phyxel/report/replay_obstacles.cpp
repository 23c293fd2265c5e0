#include "report/replay_obstacles.hpp"

#include <fmt/format.h>

#include "phyxel/physics/obstacles.hpp"
#include "report/page.hpp"

namespace phyxel::app {
namespace {

using Json = nlohmann::ordered_json;

/// The rotation and the translation of an obstacle.
Json place_of(const ObstacleStep& step, const Extent& extent) {
  Json place = Json::array();
  for (int e = 0; e < 9; ++e) place.push_back(step.turn(e / 3, e % 3));
  const Vec3d centred = (1 / extent.radius) * (step.place - extent.centre());
  for (int axis = 0; axis < 3; ++axis) place.push_back(component(centred, axis));
  return place;
}

}  // namespace

Json obstacles_json(const std::vector<Obstacle>& obstacles, const RigidPaths& paths,
                    std::span<const double> times, const Extent& extent) {
  Json all = Json::array();
  for (const Obstacle& obstacle : obstacles) {
    Json one{{"name", obstacle.name}, {"hollow", obstacle.hollow}};
    ObstacleShapes::with(obstacle.form, [&]<class Shape>(const Shape&) {
      one["shape"] = Shape::name;
      one["lengths"] = Json::array();
      for (std::size_t k = 0; k < std::size(Shape::lengths); ++k) {
        one["lengths"].push_back(obstacle.form.lengths[k] / extent.radius);
      }
    });
    one["places"] = Json::array();
    const bool rests = obstacle.stands_still();
    for (const double time : rests ? times.first(1) : times) {
      one["places"].push_back(place_of(paths.at(obstacle, time), extent));
    }
    all.push_back(std::move(one));
  }
  return all;
}

double embedded_size(const std::vector<Obstacle>& obstacles) {
  double bytes = 0;
  for (const Obstacle& obstacle : obstacles) {
    if (!obstacle.surface) continue;
    bytes += 12.0 * static_cast<double>(obstacle.surface->position.size() +
                                        obstacle.surface->triangle.size());
  }
  return bytes;
}

namespace {

/// The vertices of an obstacle's mesh in its own coordinates, in units of the radius of `extent`.
std::vector<float> scaled_vertices(const Surface& surface, const Extent& extent) {
  std::vector<float> numbers;
  for (const Vec3d x : surface.position) {
    for (int axis = 0; axis < 3; ++axis) {
      numbers.push_back(static_cast<float>(component(x, axis) / extent.radius));
    }
  }
  return numbers;
}

}  // namespace

std::string obstacle_elements(const std::vector<Obstacle>& obstacles, const Extent& extent) {
  std::string elements;
  for (std::size_t k = 0; k < obstacles.size(); ++k) {
    if (!obstacles[k].surface) continue;
    const Surface& surface = *obstacles[k].surface;
    const std::vector<float> vertices = scaled_vertices(surface, extent);
    elements += byte_element(fmt::format("obstacle{}", k), std::as_bytes(std::span(vertices)));
    elements += byte_element(fmt::format("obstacle{}-triangles", k),
                             std::as_bytes(std::span(surface.triangle)));
  }
  return elements;
}

Obstacle floor_under(const std::vector<Instance>& instances, const Extent& extent, Vec3d up,
                     double gap) {
  Span height;
  for (const Instance& instance : instances) {
    for (const auto* points : {&instance.surfels, &instance.phyxels}) {
      for (const Vec3d& p : *points) height.include(dot(p, normalised(up)));
    }
  }
  return floor_below(up, extent.centre(), height.low - gap, 2 * extent.radius);
}

}  // namespace phyxel::app
