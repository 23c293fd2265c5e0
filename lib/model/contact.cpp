#include "model/contact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "mesh/distance_field.hpp"
#include "mesh/triangle.hpp"
#include "model/assembly.hpp"
#include "model/body_contact.hpp"
#include "model/box_overlaps.hpp"
#include "model/parts.hpp"
#include "model/rigid_tips.hpp"
#include "model/spatial_hash.hpp"
#include "model/symmetry.hpp"
#include "phyxel/error.hpp"
#include "rank_exchange.hpp"
#include "scene/scene_error.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

constexpr double on_surface = 0.1;       // spacings
constexpr double beside_surface = 0.75;  // spacings: in cells, phyxels lie half of one below it

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
  Index phyxel = 0;
  std::size_t obstacle = 0;
};

/// The phyxel of a part that is nearest to a point, and its distance [m]; infinite if the point is
/// outside the box around the part's phyxels of this rank.
std::pair<Index, double> nearest_in(const Model& model, const Part& part, Vec3d point) {
  const auto first = static_cast<std::size_t>(part.begin);
  const auto count = static_cast<std::size_t>(part.owned_end()) - first;
  if (count == 0) return {0, HUGE_VAL};
  const Box box = box_around(std::span(model.position).subspan(first, count));
  if (!contains(box, point)) return {0, HUGE_VAL};
  std::pair<Index, double> nearest{0, HUGE_VAL};
  for (Index i = part.begin; i < part.owned_end(); ++i) {
    const double distance = norm(model.position[i] - point);
    if (distance < nearest.second) nearest = {i, distance};
  }
  return nearest;
}

/// Finds it among the phyxels of the surface, and where the middle of an obstacle is inside a body.
Deepest deepest_of(const Model& model) {
  Deepest found;
  const ContactLayer& layer = model.contact;
  const std::vector<LayerGroup> groups = groups_of(model, layer);
  const PlacedLayer placed(model, groups, [](Index) { return Vec3d{}; });
  for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
    const Obstacle& obstacle = model.obstacles[o];
    const ObstacleStep rest = obstacle.step_from(0, 0);
    placed.for_each_inside(obstacle, rest, [&](std::size_t k, Vec3d, const Gap& gap) {
      if (-gap.distance > found.depth) found = {-gap.distance, layer.phyxels[k], o};
    });
    if (obstacle.hollow || !obstacle.is_bounded()) continue;
    for (const Part& part : model.parts) {
      const auto [i, distance] =
          nearest_in(model, part, rest.turn * obstacle.middle() + rest.place);
      const bool is_inside = distance < 0.5 * model.neighbourhood.support[i];
      const double depth = obstacle.inner_radius();
      if (is_inside && depth > found.depth) found = {depth, i, o};
    }
  }
  return found;
}

/// Finds the distances from the surface of a mesh, as finely as phyxels are spaced. Obstacles of
/// the same surface share them.
/// @param earlier obstacles that have theirs
/// @param support the smallest one of phyxels that touch [m]
void set_field_for(Obstacle& obstacle, std::span<const Obstacle> earlier, double support,
                   std::vector<std::string>& warnings) {
  const double extent = box_around(obstacle.surface->position).extent();
  const double wanted = std::min(nodes_over_support * support,
                                 (support < HUGE_VAL ? std::max(extent, support) : extent) / 32);
  const auto same = std::find_if(earlier.begin(), earlier.end(), [&](const Obstacle& other) {
    return other.surface && (other.surface == obstacle.surface ||
                             (other.surface->position == obstacle.surface->position &&
                              other.surface->triangle == obstacle.surface->triangle));
  });
  const double made = same != earlier.end()
                          ? obstacle.share_field(*same)
                          : obstacle.set_field(wanted, support < HUGE_VAL ? support : 0);
  if (made <= 1.01 * wanted) return;
  warnings.push_back(fmt::format(
      "the surface of obstacle \"{}\" is rounded to {:.3g} m, coarser than the {:.3g} m that the "
      "bodies' phyxels resolve: finer would take more than {:.0f} MB",
      obstacle.name, made, wanted, most_field_nodes * sizeof(float) / 1e6));
}

/// The surface of a body of a whole model, at rest.
Surface surface_of_body(const Model& model, std::size_t body) {
  Surface surface;
  const auto part = std::find_if(model.parts.begin(), model.parts.end(), [&](const Part& p) {
    return static_cast<std::size_t>(p.body) == body;
  });
  surface.position.assign(model.surfels.position.begin() + part->surfel_begin,
                          model.surfels.position.begin() + part->surfel_end);
  for (const Triangle& t : model.surfels.triangles_of(*part)) {
    const Index first = part->surfel_begin;
    surface.triangle.push_back({t[0] - first, t[1] - first, t[2] - first});
  }
  return surface;
}

}  // namespace

void check_touches(const BodyRequest& request, std::span<const Triangle> triangles) {
  if (!triangles.empty()) return;
  throw InputError(named(
      request, fmt::format("body \"{}\" has no surface with which to touch the scene's obstacles "
                           "or other bodies; allowed: a mesh, a shape with surfels, a file with a "
                           "surface, or nothing to touch",
                           request.name)));
}

void check_layer(const BodyRequest& request, const LayerCounts& counts) {
  if (counts.on + counts.beside > 0) return;
  throw InputError(
      named(request,
            fmt::format("body \"{}\" has no phyxel within {:g} spacings of its surface with which "
                        "to touch the scene's obstacles or other bodies; allowed: phyxels that "
                        "fill the surface, or nothing to touch",
                        request.name, beside_surface)));
}

std::vector<double> distances_from_surface(std::span<const Vec3d> position,
                                           std::span<const double> spacing,
                                           std::span<const Vec3d> surface,
                                           std::span<const Triangle> triangles, Index first) {
  std::vector<double> distance(position.size(), HUGE_VAL);
  if (position.empty()) return distance;
  const double largest = *std::max_element(spacing.begin(), spacing.end());
  if (!(largest > 0)) return distance;  // phyxels without neighbours
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
            double& least = distance[entry.index];
            // The triangle is no nearer than the ball around it.
            if (norm(x - middle) - radius > std::min(reach, least)) return;
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

namespace {

/// Adds the points of surfaces that are held or moved along all axes, for free rigid bodies. Of a
/// share: collective. @param supported as of `supported_phyxels`
void add_held_points(Model& model, std::span<const double> offset,
                     std::span<const char> supported) {
  if (free_bodies(model).empty()) return;
  std::map<Index, HeldPoint> found;  // by index
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    const Axes axes = model.motions[m].axes;
    for (const Index i : model.motions[m].phyxels) {
      if (offset[i] < 0 || !supported[i] || !model.owns(i)) continue;
      HeldPoint& point = found[i];
      point.id = model.global_id(i);
      point.rest = model.position[i];
      point.offset = offset[i];
      point.support = model.neighbourhood.support[i];
      for (const int axis : {0, 1, 2}) {
        if (axes.bits() >> axis & 1) point.motion[axis] = static_cast<Index>(m);
      }
    }
  }
  std::vector<HeldPoint> own;
  for (const auto& entry : found) own.push_back(entry.second);
  model.held_points = own;
  if (model.share) {
    const Communicator& ranks = *model.share->communicator;
    model.held_points.clear();
    for (const std::vector<HeldPoint>& some : allgathered(ranks, own)) {
      model.held_points.insert(model.held_points.end(), some.begin(), some.end());
    }
  }
  std::sort(model.held_points.begin(), model.held_points.end(),
            [](const HeldPoint& a, const HeldPoint& b) { return a.id < b.id; });
}

}  // namespace

void add_contact_layer(Model& model, std::span<const double> offset) {
  if (model.obstacles.empty()) return;
  const std::vector<char> supported = supported_phyxels(model);
  add_held_points(model, offset, supported);
  for (Index i = 0; i < model.size(); ++i) {
    if (offset[i] < 0 || supported[i] || !model.owns(i)) continue;
    model.contact.phyxels.push_back(i);
    model.contact.offset.push_back(offset[i]);
  }
}

bool is_deepest_overlap(const Model& model, double depth, Index phyxel, double tolerance) {
  const auto largest = [&](double value) {
    return model.share ? model.share->communicator->largest(value) : value;
  };
  const double support = depth > 0 ? model.neighbourhood.support[phyxel] : 0;
  const bool is_here = depth == largest(depth) && depth > tolerance * support;
  // Of several ranks with equal depths, the first phyxel counts.
  const double id = is_here ? static_cast<double>(model.global_id(phyxel)) : HUGE_VAL;
  return id == -largest(-id) && is_here;
}

namespace {

// The rounding of coordinates, and of surfaces in files in float, as a share of a support.
constexpr double rounding = 1e-6;

/// The error of a model in which a held point is inside a free body at the start; empty if none is.
/// Of a share: the same on all ranks.
std::string held_overlap_at_start(const Model& model, const Scene& scene) {
  for (const std::size_t o : free_bodies(model)) {
    const Obstacle& obstacle = model.obstacles[o];
    const ObstacleStep at = obstacle.placed(obstacle.start);
    const HeldPoint* deepest = nullptr;
    double depth = 0;
    ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
      for (const HeldPoint& point : model.held_points) {
        const double here = point.offset - gap_to(shape, at, point.rest).distance;
        if (!(here > rounding * point.support && here > depth)) continue;
        deepest = &point;
        depth = here;
      }
    });
    if (!deepest) continue;
    const std::string& where = scene.obstacles[o].where;
    const Vec3d x = deepest->rest;
    return fmt::format(
        "{}{}body \"{}\" is {:.3g} m deep in obstacle \"{}\" at the start, at ({:.6g}, {:.6g}, "
        "{:.6g}) m, by phyxels that supports hold or move, and the obstacle is a free body; "
        "allowed: to touch it",
        where, where.empty() ? "" : ": ",
        scene.bodies[static_cast<std::size_t>(body_of_id(model, deepest->id))].name, depth,
        obstacle.name, x.x, x.y, x.z);
  }
  return {};
}

}  // namespace

std::string overlap_at_start(const Model& model, const Scene& scene) {
  if (model.obstacles.empty()) return {};
  for (const std::string& problem :
       {rigid_overlap_at_start(model, scene), held_overlap_at_start(model, scene)}) {
    if (problem.empty()) continue;
    const bool is_first = !model.share || model.share->communicator->rank() == 0;
    return is_first ? problem : "";
  }
  const Deepest found = deepest_of(model);
  if (!is_deepest_overlap(model, found.depth, found.phyxel, rounding)) return {};
  const Index i = found.phyxel;
  const double depth = found.depth;
  const Obstacle& obstacle = model.obstacles[found.obstacle];
  const Vec3d x = model.position[i];
  const std::string& where = scene.obstacles[found.obstacle].where;
  return fmt::format(
      "{}{}body \"{}\" is {:.3g} m deep in obstacle \"{}\" at the start, at ({:.6g}, {:.6g}, "
      "{:.6g}) m; allowed: to touch it, or to begin {}",
      where, where.empty() ? "" : ": ", part_of(model, i).name, depth, obstacle.name, x.x, x.y, x.z,
      obstacle.hollow ? "inside, as it is hollow" : "outside");
}

void set_fields(Model& model) {
  double least = HUGE_VAL, support = 0;  // of the phyxels that touch [m]
  for (const Index i : model.contact.phyxels) {
    least = std::min(least, model.neighbourhood.support[i]);
    support = std::max(support, model.neighbourhood.support[i]);
  }
  for (const HeldPoint& point : model.held_points) {
    least = std::min(least, point.support);
    support = std::max(support, point.support);
  }
  if (model.share) {
    least = model.share->communicator->smallest(least);
    support = model.share->communicator->largest(support);
  }
  for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
    Obstacle& obstacle = model.obstacles[o];
    const std::span earlier = std::span(model.obstacles).first(o);
    if (obstacle.surface) set_field_for(obstacle, earlier, least, model.warnings);
    const double radius = obstacle.inner_radius();
    if (radius >= support) continue;
    model.warnings.push_back(fmt::format(
        "obstacle \"{}\" is {:.3g} m thick, less than two supports of {:.3g} m of the bodies' "
        "phyxels: it may pass between them, or through a body that is fast",
        obstacle.name, 2 * radius, support));
  }
}

bool touches_anything(const Scene& scene, std::size_t body) {
  return !scene.obstacles.empty() || touches_bodies(scene, body);
}

namespace {

/// A body that touches something, and the distances of its phyxels from its surface.
struct TouchingBody {
  const Part& first;                      ///< Of its parts.
  std::size_t begin = 0, count = 0;       ///< Its phyxels.
  std::vector<double> spacing, distance;  ///< Of each phyxel [m].
};

std::vector<TouchingBody> touching_bodies(const Model& model, const Scene& scene) {
  std::vector<TouchingBody> bodies;
  for (auto part = model.parts.begin(); part != model.parts.end();) {
    const auto next = part + static_cast<std::ptrdiff_t>(model.parts_of_body(*part).size());
    const auto body = static_cast<std::size_t>(part->body);
    const auto begin = static_cast<std::size_t>(part->begin);
    const std::size_t count = static_cast<std::size_t>((next - 1)->end) - begin;
    if (count > 0 && touches_anything(scene, body)) {
      check_touches(scene.bodies[body], model.surfels.triangles_of(*part));
      bodies.push_back({*part, begin, count, {}, {}});
    }
    part = next;
  }
  return bodies;
}

void find_distances(const Model& model, const Scene& scene, TouchingBody& body) {
  const Part& part = body.first;
  const NeighbourhoodRule& rule = scene.bodies[static_cast<std::size_t>(part.body)].neighbourhood;
  for (std::size_t k = 0; k < body.count; ++k) {
    body.spacing.push_back(local_spacing(rule, model.neighbourhood.support[body.begin + k]));
  }
  body.distance = distances_from_surface(
      std::span(model.position).subspan(body.begin, body.count), body.spacing,
      std::span(model.surfels.position)
          .subspan(part.surfel_begin, part.surfel_end - part.surfel_begin),
      model.surfels.triangles_of(part), part.surfel_begin);
}

}  // namespace

void add_contact(Model& model, const Scene& scene) {
  model.obstacles = obstacles_of(scene);
  if (model.obstacles.empty() && !scene.contact) return;
  std::vector<TouchingBody> bodies = touching_bodies(model, scene);
#pragma omp parallel for schedule(dynamic)
  for (std::size_t b = 0; b < bodies.size(); ++b) find_distances(model, scene, bodies[b]);
  std::vector<double> offset(model.position.size(), -1);
  for (const TouchingBody& body : bodies) {
    LayerCounts counts;
    for (std::size_t k = 0; k < body.count; ++k) counts.add(body.distance[k], body.spacing[k]);
    check_layer(scene.bodies[static_cast<std::size_t>(body.first.body)], counts);
    for (std::size_t k = 0; k < body.count; ++k) {
      offset[body.begin + k] =
          contact_offset(body.distance[k], body.spacing[k], counts.has_layer());
    }
  }
  add_contact_layer(model, offset);
  set_fields(model);
  const std::vector<LayerSupports> supports = add_body_layer(model, scene, offset);
  add_body_surfaces(model, scene, supports,
                    [&](std::size_t body) { return surface_of_body(model, body); });
  for (const std::string& problem :
       {overlap_at_start(model, scene), bodies_overlap_at_start(model, scene)}) {
    if (!problem.empty()) throw InputError(problem);
  }
}

}  // namespace phyxel
