#include "scene/scene_obstacles.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "phyxel/error.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "scene/key_parts.hpp"
#include "scene/scene_body.hpp"
#include "scene/scene_source.hpp"

namespace phyxel {
namespace {

/// The keys of the lengths that a shape has; nothing for an unknown one.
std::optional<std::set<std::string>> keys_of_shape(const std::string& shape) {
  std::optional<std::set<std::string>> keys;
  ObstacleShapes::for_each([&]<class Shape>(std::type_identity<Shape>) {
    if (shape != Shape::name) return;
    keys.emplace();
    for (const ObstacleLength& length : Shape::lengths) keys->insert(length.name);
    if constexpr (requires(Shape s) { s.field; }) keys->insert("mesh");
  });
  return keys;
}

constexpr const char* keys_of_lengths[] = {"size", "radius", "length", "mesh"};

/// Refuses lengths that an obstacle's shape does not have, and asks for those that it needs.
void check_lengths(const SceneTable& table, const std::string& shape) {
  const std::set<std::string> needed = *keys_of_shape(shape);
  for (const char* name : keys_of_lengths) {
    if (table.has(name) && !needed.contains(name)) {
      table.refuse(
          name,
          fmt::format("found, but shape = \"{}\" does not use it; allowed with it: {}", shape,
                      needed.empty() ? "no length" : fmt::format("{}", fmt::join(needed, ", "))));
    }
    if (!table.has(name) && needed.contains(name)) {
      throw InputError(fmt::format("{}: key obstacle.{}: missing; shape = \"{}\" needs it",
                                   table.where("shape"), name, shape));
    }
  }
}

ObstacleRequest read_obstacle(const SceneTable& table, std::size_t number, FilesOf files) {
  ObstacleRequest obstacle{.name = fmt::format("obstacle {}", number), .where = table.where()};
  table.read("name", obstacle.name);
  table.read("shape", obstacle.shape);
  check_lengths(table, obstacle.shape);
  table.read("size", obstacle.size);
  table.read("radius", obstacle.radius);
  table.read("length", obstacle.length);
  table.read("mesh", obstacle.mesh);
  if (table.has("mesh") && files == FilesOf::run) {
    check_file_exists(table, "mesh", obstacle.mesh);
  }
  if (table.has("scale") && !table.has("mesh")) {
    table.refuse("scale", fmt::format("found with shape = \"{}\"; allowed with a mesh only",
                                      obstacle.shape));
  }
  table.read("scale", obstacle.scale);
  if (table.has("normal")) {
    if (obstacle.shape != PlaneObstacle::name) {
      table.refuse("normal", fmt::format("found with shape = \"{}\"; allowed with \"{}\" only",
                                         obstacle.shape, PlaneObstacle::name));
    }
    table.expect_apart("normal", "rotation");
  }
  table.read("normal", obstacle.normal);
  table.read("hollow", obstacle.hollow);
  table.read("rotation", obstacle.rotation);
  table.read("translation", obstacle.translation);
  table.read("friction", obstacle.friction);
  table.read("kinetic_friction", obstacle.kinetic_friction);
  table.read("restitution", obstacle.restitution);
  if (table.has("method")) table.read_choice("method", obstacle.method.emplace());
  table.read("stiffness", obstacle.stiffness);
  if (table.has("motion")) read_path(table.table("motion"), obstacle.motion);
  table.read("density", obstacle.density);
  for (const char* key : {"velocity", "spin"}) {
    if (table.has(key) && !obstacle.density) {
      table.refuse(key, "found without a density; allowed: of a free body, which has one");
    }
  }
  table.read("velocity", obstacle.velocity);
  table.read("spin", obstacle.spin);
  if (obstacle.density && table.has("motion")) {
    table.refuse("density", "found beside obstacle.motion; allowed: one of them");
  }
  check_obstacle(obstacle);
  return obstacle;
}

}  // namespace

std::vector<ObstacleRequest> read_obstacles(const SceneTable& root, FilesOf files) {
  std::vector<ObstacleRequest> obstacles;
  std::map<std::string, std::string> places;  // of each name
  for (const SceneTable& table : root.tables("obstacle")) {
    ObstacleRequest obstacle = read_obstacle(table, obstacles.size() + 1, files);
    const auto [earlier, is_new] = places.emplace(obstacle.name, obstacle.where);
    if (!is_new) {
      table.refuse("name", fmt::format("{} found, the name of the obstacle at {} too; allowed: a "
                                       "name of its own for each obstacle",
                                       in_quotes(obstacle.name), earlier->second));
    }
    if (obstacles.size() == most_obstacles) {
      throw InputError(fmt::format("{}: obstacle: more than {} found; allowed: at most {}",
                                   obstacle.where, most_obstacles, most_obstacles));
    }
    obstacles.push_back(std::move(obstacle));
  }
  return obstacles;
}

void check_obstacle(const ObstacleRequest& obstacle) {
  const auto refuse = [&](const std::string& key, const std::string& problem) {
    throw InputError(fmt::format("{}{}key obstacle.{} of obstacle \"{}\": {}", obstacle.where,
                                 obstacle.where.empty() ? "" : ": ", key, obstacle.name, problem));
  };
  const auto keys = keys_of_shape(obstacle.shape);
  if (!keys) {
    refuse("shape", fmt::format("{} found; allowed: {}", in_quotes(obstacle.shape),
                                fmt::join(obstacle_names(), ", ")));
  }
  const auto needs_positive = [&](const char* key, double value) {
    if (keys->contains(key) && !(value > 0)) {
      refuse(key, fmt::format("{:g} found; allowed: a length above 0 m", value));
    }
  };
  needs_positive("size", std::min({obstacle.size.x, obstacle.size.y, obstacle.size.z}));
  needs_positive("radius", obstacle.radius);
  needs_positive("length", obstacle.length);
  if (keys->contains("mesh") && obstacle.mesh.empty()) {
    refuse("mesh", fmt::format("missing; shape = \"{}\" needs it", obstacle.shape));
  }
  const bool holds_nothing = obstacle.shape == PlaneObstacle::name || obstacle.hollow;
  if (obstacle.density && (!(*obstacle.density > 0) || holds_nothing)) {
    refuse("density",
           fmt::format("{:g} found; allowed: above 0 kg/m^3, of a shape that holds a volume: no "
                       "plane, and not hollow",
                       *obstacle.density));
  }
  if (obstacle.normal && *obstacle.normal == Vec3d{}) {
    refuse("normal", "[0, 0, 0] found; allowed: a direction");
  }
  if (obstacle.kinetic_friction && *obstacle.kinetic_friction > obstacle.friction) {
    refuse("kinetic_friction", fmt::format("{:g} found, above a friction of {:g}; allowed: at most "
                                           "that of a point at rest",
                                           *obstacle.kinetic_friction, obstacle.friction));
  }
}

}  // namespace phyxel
