#include "model/contact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mesh/face_relaxation.hpp"
#include "model/assembly.hpp"
#include "model/parts.hpp"
#include "model/spatial_hash.hpp"
#include "model/symmetry.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

constexpr double on_surface = 0.1;       // spacings
constexpr double beside_surface = 0.75;  // spacings: in cells, phyxels lie half of one below it
constexpr double degree = std::numbers::pi / 180;

/// The rotation that turns z to a direction.
Mat3d turn_of_normal(Vec3d direction) {
  const Vec3d n = normalised(direction), axis = cross({0, 0, 1}, n);
  const double sine = norm(axis);
  // Opposite directions have no axis in common: x serves.
  if (sine < 1e-15) return rotation_by(n.z < 0 ? Vec3d{std::numbers::pi, 0, 0} : Vec3d{});
  return rotation_by((std::atan2(sine, n.z) / sine) * axis);
}

Obstacle obstacle_of(const ObstacleRequest& request) {
  Obstacle made{.name = request.name, .hollow = request.hollow, .place = request.translation};
  int index = 0;
  ObstacleShapes::for_each([&]<class Shape>(std::type_identity<Shape>) {
    if (request.shape == Shape::name) {
      made.shape = index;
      int component = 0;
      for (std::size_t k = 0; k < std::size(Shape::lengths); ++k) {
        const std::string name = Shape::lengths[k].name;
        made.lengths[k] = name == "size"     ? phyxel::component(request.size, component++)
                          : name == "radius" ? request.radius
                                             : request.length;
      }
    }
    ++index;
  });
  made.turn =
      request.normal ? turn_of_normal(*request.normal) : rotation_by(degree * request.rotation);
  made.law = {request.friction, request.kinetic_friction.value_or(request.friction),
              request.restitution};
  const MotionRequest& m = request.motion;
  made.motion = {.phyxels = {},
                 .displacement = m.displacement,
                 .rotation = degree * m.rotation,
                 .about = m.about,
                 .duration = m.duration,
                 .velocity = m.velocity,
                 .amplitude = m.amplitude,
                 .frequency = m.frequency};
  return made;
}

/// Calls visit(a, b, c) for the parts of a triangle halved until no edge is longer than `longest`.
template <class Visit>
void visit_parts(Vec3d a, Vec3d b, Vec3d c, double longest, Visit&& visit) {
  const double ab = norm(b - a), bc = norm(c - b), ca = norm(a - c);
  if (std::max({ab, bc, ca}) <= longest) {
    visit(a, b, c);
  } else if (ab >= bc && ab >= ca) {
    const Vec3d middle = 0.5 * (a + b);
    visit_parts(a, middle, c, longest, visit);
    visit_parts(middle, b, c, longest, visit);
  } else {
    visit_parts(b, c, a, longest, visit);
  }
}

/// The phyxel that is deepest inside an obstacle.
struct Deepest {
  double depth = 0;  ///< [m]
  std::size_t at = 0, obstacle = 0;
};

Deepest deepest_of(const Model& model) {
  Deepest found;
  const ContactLayer& layer = model.contact;
  for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
    const Obstacle& obstacle = model.obstacles[o];
    const ObstacleStep rest = obstacle.step_from(0, 0);
    ObstacleShapes::with(obstacle.shape, obstacle.lengths.data(), [&](const auto& shape) {
      for (std::size_t k = 0; k < layer.phyxels.size(); ++k) {
        const Gap gap = gap_to(shape, rest, model.position[layer.phyxels[k]]);
        const double depth = layer.offset[k] - gap.distance;
        if (depth > found.depth) found = {depth, k, o};
      }
    });
  }
  return found;
}

}  // namespace

std::vector<Obstacle> obstacles_of(const Scene& scene) {
  std::vector<Obstacle> all;
  for (const ObstacleRequest& request : scene.obstacles) all.push_back(obstacle_of(request));
  return all;
}

ObstacleStep Obstacle::step_between(const Path& before, const Path& after, double dt) const {
  ObstacleStep step{.turn_at_rest = turn, .place_at_rest = place};
  step.turn = (identity<double>() + after.turn) * turn;
  step.place = place + after.at(place);
  step.hollow = hollow;
  step.law = law;
  step.dt = dt;
  if (dt == 0 || motion.stands_still()) return step;
  step.velocity = (after.at(place) - before.at(place)) / dt;
  step.slope = (1 / dt) * (after.turn - before.turn);
  return step;
}

ObstacleStep Obstacle::step_from(double time, double dt) const {
  ObstacleStep step = step_between(motion.path_at(time), motion.path_at(time + dt), dt);
  if (dt == 0 || motion.stands_still()) return step;
  const Path mean = motion.mean_step(time, dt);
  step.mean_velocity = mean.at(place) / dt;
  step.mean_slope = (1 / dt) * mean.turn;
  return step;
}

void check_touches(const BodyRequest& request, std::span<const Triangle> triangles) {
  if (!triangles.empty()) return;
  throw InputError(
      fmt::format("{}{}body \"{}\" has no surface with which to touch the scene's obstacles; "
                  "allowed: a mesh, a "
                  "shape with surfels, a file with a surface, or no obstacle",
                  request.where, request.where.empty() ? "" : ": ", request.name));
}

std::vector<double> distances_from_surface(std::span<const Vec3d> position,
                                           std::span<const double> spacing,
                                           std::span<const Vec3d> surface,
                                           std::span<const Triangle> triangles, Index first) {
  std::vector<double> distance(position.size(), HUGE_VAL);
  if (position.empty()) return distance;
  const double largest = *std::max_element(spacing.begin(), spacing.end());
  const double reach = beside_surface * largest;
  const SpatialHash hash(position, 2 * largest);
  for (const Triangle& t : triangles) {
    visit_parts(
        surface[t[0] - first], surface[t[1] - first], surface[t[2] - first], 2 * largest,
        [&](Vec3d a, Vec3d b, Vec3d c) {
          const Vec3d middle = (a + b + c) / 3.0;
          const double radius = std::max({norm(a - middle), norm(b - middle), norm(c - middle)});
          hash.visit_ball(middle, radius + reach, [&](const SpatialHash::Entry& entry) {
            const Vec3d x = entry.position;
            if (norm(x - middle) > radius + reach) return;
            double& least = distance[entry.index];
            least = std::min(least, norm(x - nearest_on_triangle(x, a, b, c)));
          });
        });
  }
  for (std::size_t i = 0; i < distance.size(); ++i) {
    if (distance[i] > beside_surface * spacing[i]) distance[i] = HUGE_VAL;
  }
  return distance;
}

void LayerCounts::add(double distance, double spacing) {
  if (distance <= on_surface * spacing) {
    ++on;
  } else if (distance < HUGE_VAL) {
    ++beside;
  }
}

double contact_offset(double distance, double spacing, bool has_layer) {
  if (distance <= on_surface * spacing) return has_layer ? 0 : distance;
  return has_layer || distance == HUGE_VAL ? -1 : distance;
}

void add_contact_layer(Model& model, std::span<const double> offset) {
  if (model.obstacles.empty()) return;
  const std::vector<char> supported = supported_phyxels(model);
  for (Index i = 0; i < model.size(); ++i) {
    if (offset[i] < 0 || supported[i] || !model.owns(i)) continue;
    model.contact.phyxels.push_back(i);
    model.contact.offset.push_back(offset[i]);
  }
}

std::string overlap_at_start(const Model& model, const Scene& scene) {
  if (model.obstacles.empty()) return {};
  const Deepest found = deepest_of(model);
  const auto largest = [&](double value) {
    return model.share ? model.share->communicator->largest(value) : value;
  };
  const double depth = largest(found.depth);
  // The rounding of coordinates, and of surfaces in files in float.
  constexpr double rounding = 1e-6;
  const Index i = model.contact.phyxels.empty() ? 0 : model.contact.phyxels[found.at];
  const double support = model.contact.phyxels.empty() ? 0 : model.neighbourhood.support[i];
  const bool is_here = found.depth == depth && depth > rounding * support;
  // Of several ranks with equal depths, the first phyxel counts.
  const double id = is_here ? static_cast<double>(model.global_id(i)) : HUGE_VAL;
  const double first = -largest(-id);
  if (!is_here || id != first) return {};
  const Obstacle& obstacle = model.obstacles[found.obstacle];
  const Vec3d x = model.position[i];
  const std::string& where = scene.obstacles[found.obstacle].where;
  return fmt::format(
      "{}{}body \"{}\" is {:.3g} m deep in obstacle \"{}\" at the start, at ({:.6g}, {:.6g}, "
      "{:.6g}) m; allowed: to touch it, or to begin {}",
      where, where.empty() ? "" : ": ", part_of(model, i).name, depth, obstacle.name, x.x, x.y, x.z,
      obstacle.hollow ? "inside, as it is hollow" : "outside");
}

void add_contact(Model& model, const Scene& scene) {
  model.obstacles = obstacles_of(scene);
  if (model.obstacles.empty()) return;
  std::vector<double> offset(model.position.size(), -1);
  for (auto part = model.parts.begin(); part != model.parts.end();) {
    const auto next = part + static_cast<std::ptrdiff_t>(model.parts_of_body(*part).size());
    const BodyRequest& request = scene.bodies[static_cast<std::size_t>(part->body)];
    const auto begin = static_cast<std::size_t>(part->begin),
               count = static_cast<std::size_t>((next - 1)->end) - begin;
    const std::span<const Triangle> triangles = model.surfels.triangles_of(*part);
    if (count > 0) check_touches(request, triangles);
    const std::vector<double> spacing = tabulated(count, [&](std::size_t k) {
      return local_spacing(request.neighbourhood, model.neighbourhood.support[begin + k]);
    });
    const std::vector<double> distance = distances_from_surface(
        std::span(model.position).subspan(begin, count), spacing,
        std::span(model.surfels.position)
            .subspan(part->surfel_begin, part->surfel_end - part->surfel_begin),
        triangles, part->surfel_begin);
    LayerCounts counts;
    for (std::size_t k = 0; k < count; ++k) counts.add(distance[k], spacing[k]);
    for (std::size_t k = 0; k < count; ++k) {
      offset[begin + k] = contact_offset(distance[k], spacing[k], counts.has_layer());
    }
    part = next;
  }
  add_contact_layer(model, offset);
  if (const std::string problem = overlap_at_start(model, scene); !problem.empty()) {
    throw InputError(problem);
  }
}

}  // namespace phyxel
