/// Obstacles: their shapes and their paths.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "mesh/distance_field.hpp"
#include "model/assembly.hpp"
#include "model/closed_mesh.hpp"
#include "model/contact.hpp"
#include "model/symmetry.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

constexpr double degree = std::numbers::pi / 180;

/// The rotation that turns z to a direction.
Mat3d turn_of_normal(Vec3d direction) {
  const Vec3d n = normalised(direction), axis = cross({0, 0, 1}, n);
  const double sine = norm(axis);
  // Opposite directions have no axis in common: x serves.
  if (sine < 1e-15) return rotation_by(n.z < 0 ? Vec3d{std::numbers::pi, 0, 0} : Vec3d{});
  return rotation_by((std::atan2(sine, n.z) / sine) * axis);
}

/// The surface of a mesh, scaled.
std::shared_ptr<const Surface> surface_of(const ObstacleRequest& request) {
  Surface surface = read_closed_mesh(request.mesh, request.where);
  for (Vec3d& x : surface.position) x = request.scale * x;
  return std::make_shared<const Surface>(std::move(surface));
}

/// The moments of the inside of a closed surface: sums over the tetrahedra between the origin and
/// its triangles.
SolidMoments solid_of(const Surface& surface) {
  SolidMoments sum;
  for (const Triangle& t : surface.triangle) {
    const Vec3d a = surface.position[t[0]], b = surface.position[t[1]], c = surface.position[t[2]];
    const double six = dot(a, cross(b, c));  // volumes of the tetrahedron
    const Vec3d s = a + b + c;
    sum.volume += six / 6;
    sum.first += (six / 24) * s;
    const auto add = [&](double& entry, auto&& of) {
      entry += six / 120 * (of(s) + of(a) + of(b) + of(c));
    };
    add(sum.second.xx, [](Vec3d x) { return x.x * x.x; });
    add(sum.second.xy, [](Vec3d x) { return x.x * x.y; });
    add(sum.second.xz, [](Vec3d x) { return x.x * x.z; });
    add(sum.second.yy, [](Vec3d x) { return x.y * x.y; });
    add(sum.second.yz, [](Vec3d x) { return x.y * x.z; });
    add(sum.second.zz, [](Vec3d x) { return x.z * x.z; });
  }
  return sum;
}

SolidMoments solid_of(const Obstacle& obstacle) {
  if (obstacle.surface) return solid_of(*obstacle.surface);
  return ObstacleShapes::with(obstacle.form, [](const auto& shape) {
    if constexpr (requires { shape.solid(); }) return shape.solid();
    return SolidMoments{};
  });
}

/// Makes an obstacle a free body.
void set_free(Obstacle& made, const ObstacleRequest& request) {
  const SolidMoments solid = solid_of(made);
  const double density = *request.density, volume = solid.volume;
  if (!(volume > 0)) {
    throw InputError(fmt::format(
        "{}{}obstacle \"{}\" holds {:g} m³, and cannot be free; allowed: a closed surface whose "
        "triangles look outwards",
        request.where, request.where.empty() ? "" : ": ", request.name, volume));
  }
  const Vec3d m = solid.first / volume;
  const Sym3d& s = solid.second;
  const double xx = s.xx - volume * m.x * m.x, yy = s.yy - volume * m.y * m.y,
               zz = s.zz - volume * m.z * m.z;
  const Sym3d own{yy + zz, volume * m.x * m.y - s.xy, volume * m.x * m.z - s.xz,
                  xx + zz, volume * m.y * m.z - s.yz, xx + yy};
  made.free =
      RigidMass{density * volume, made.place + made.turn * m, turned(made.turn, density * own)};
  made.start.place = made.free->centre;
  made.start.velocity = request.velocity;
  made.start.angular_momentum = made.free->inertia * request.spin;
}

/// The stiffness of penalties of an obstacle, or 0.
/// @param shared the [contact] of the scene
double penalty_of(const ObstacleRequest& request, const ContactRequest& shared) {
  const bool acts = request.method.value_or(shared.method) == ContactMethod::penalty;
  return acts ? request.stiffness.value_or(shared.stiffness) : 0;
}

Obstacle obstacle_of(const ObstacleRequest& request, const ContactRequest& shared) {
  Obstacle made{.name = request.name, .hollow = request.hollow, .place = request.translation};
  int index = 0;
  ObstacleShapes::for_each([&]<class Shape>(std::type_identity<Shape>) {
    if (request.shape == Shape::name) {
      made.form.shape = index;
      int component = 0;
      for (std::size_t k = 0; k < std::size(Shape::lengths); ++k) {
        const std::string name = Shape::lengths[k].name;
        made.form.lengths[k] = name == "size"     ? phyxel::component(request.size, component++)
                               : name == "radius" ? request.radius
                                                  : request.length;
      }
    }
    ++index;
  });
  if (!request.mesh.empty()) made.surface = surface_of(request);
  made.turn =
      request.normal ? turn_of_normal(*request.normal) : rotation_by(degree * request.rotation);
  made.law = {request.friction, request.kinetic_friction.value_or(request.friction),
              request.restitution};
  made.penalty = penalty_of(request, shared);
  made.motion = motion_along(request.motion);
  if (request.density) set_free(made, request);
  return made;
}

/// Where a free body is, as a path.
Path path_to(const RigidMass& mass, const RigidState& state) {
  return {state.place - mass.centre, change_by(state.turn), mass.centre};
}

/// Sets the rigid motion of a step.
/// @param change of the path over `span` [s], about the instant at which it is at `middle`
/// @param end place on the path at the end of the step
void set_rigid_motion(ObstacleStep& step, const Path& change, double span, const Path& middle,
                      const Path& end) {
  step.drift = change.displacement / span;
  step.centre = end.about + end.displacement;
  const Mat3d rate = (1 / span) * (change.turn * transpose(identity<double>() + middle.turn));
  step.spin = 0.5 * (rate - transpose(rate));
}

}  // namespace

std::vector<Obstacle> obstacles_of(const Scene& scene) {
  std::vector<Obstacle> all;
  const ContactRequest shared = scene.contact.value_or(ContactRequest{});
  for (const ObstacleRequest& request : scene.obstacles) {
    all.push_back(obstacle_of(request, shared));
  }
  return all;
}

ObstacleStep Obstacle::step_between(const Path& before, const Path& after, double dt) const {
  ObstacleStep step{.turn_at_rest = turn, .place_at_rest = place};
  step.turn = (identity<double>() + after.turn) * turn;
  step.place = place + after.at(place);
  step.hollow = hollow;
  step.law = law;
  step.dt = dt;
  if (dt == 0 || stands_still()) return step;
  step.velocity = (after.at(place) - before.at(place)) / dt;
  step.slope = (1 / dt) * (after.turn - before.turn);
  return step;
}

ObstacleStep Obstacle::step_from(double time, double dt) const {
  const Path after = motion.path_at(time + dt);
  ObstacleStep step = step_between(motion.path_at(time), after, dt);
  if (dt == 0 || stands_still()) return step;
  set_rigid_motion(step, motion.mean_step(time, dt), dt, motion.path_at(time), after);
  return step;
}

ObstacleStep Obstacle::stage_to(double time, double span) const {
  const Path now = motion.path_at(time);
  ObstacleStep step = step_between(motion.path_at(time - span), now, span);
  if (span == 0 || stands_still()) return step;
  const Path before = motion.path_at(time - span / 2), after = motion.path_at(time + span / 2);
  const Path change{after.displacement - before.displacement, after.turn - before.turn, now.about};
  set_rigid_motion(step, change, span, now, now);
  return step;
}

ObstacleStep Obstacle::placed(const RigidState& state) const {
  const Path here = path_to(*free, state);
  ObstacleStep step = step_between(here, here, 0);
  step.drift = state.velocity;
  step.centre = state.place;
  step.spin = cross_matrix(angular_velocity(free->inertia, state));
  step.velocity = rigid_velocity(step, step.place);
  step.slope = step.spin * rotation_of(state.turn);
  return step;
}

ObstacleStep Obstacle::step_between(const RigidState& before, const RigidState& after,
                                    double dt) const {
  ObstacleStep step = step_between(path_to(*free, before), path_to(*free, after), dt);
  step.drift = 0.5 * (before.velocity + after.velocity);
  RigidState mean = before;
  mean.angular_momentum = 0.5 * (before.angular_momentum + after.angular_momentum);
  step.spin = cross_matrix(angular_velocity(free->inertia, mean));
  step.centre = after.place;
  return step;
}

double Obstacle::set_field(double spacing, double band) {
  if (!surface) return 0;
  distances = std::make_shared<const DistanceArrays>(distances_from(*surface, spacing, band));
  form.field = distances->view();
  return form.field.spacing;
}

double Obstacle::share_field(const Obstacle& other) {
  surface = other.surface;
  distances = other.distances;
  form.field = other.form.field;
  return form.field.spacing;
}

bool Obstacle::is_bounded() const {
  return surface ||
         ObstacleShapes::with(form, [](const auto& s) { return std::size(s.lengths) > 0; });
}

double Obstacle::inner_radius() const {
  if (hollow || !is_bounded()) return HUGE_VAL;
  if (surface) return distances->depth;
  return ObstacleShapes::with(form, [](const auto& s) {
    return -s.gap(Vec3d{}).distance;  // its centre is its deepest point
  });
}

Vec3d Obstacle::middle() const { return surface ? distances->deepest : Vec3d{}; }

double Obstacle::largest_speed(const ObstacleStep& step) const {
  double square = 0;  // of the change of the rotation, whose rate is 1/sqrt(2) of it
  for (int e = 0; e < 9; ++e) square += step.slope(e / 3, e % 3) * step.slope(e / 3, e % 3);
  double reach = 0;  // of its surface from its origin
  if (surface) {
    for (const Vec3d x : surface->position) reach = std::max(reach, norm(x));
  } else if (is_bounded()) {
    ObstacleShapes::with(form, [&](const auto& shape) {
      if constexpr (requires { shape.for_each_tip([](Vec3d, double, Vec3d) {}); }) {
        shape.for_each_tip(
            [&](Vec3d x, double radius, Vec3d) { reach = std::max(reach, norm(x) + radius); });
      }
    });
  }
  return norm(step.velocity) + std::sqrt(0.5 * square) * reach;
}

}  // namespace phyxel
