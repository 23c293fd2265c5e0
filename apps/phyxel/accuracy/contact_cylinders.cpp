/// Problems of contact in plane strain: a cylinder between planes, and a strap on a drum.
#include <cmath>
#include <numbers>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "accuracy/round_bodies.hpp"
#include "accuracy/touching.hpp"

namespace phyxel::app {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double far = 9;  // beyond all bodies [m]

/// Holds all phyxels of a body along z: plane strain.
void hold_along_z(BodyRequest& body) {
  FixRequest held{.select = {.box = Selection::Box{{-far, -far, -far}, {far, far, far}}}};
  held.axes = {.x = false, .y = false, .z = true};
  body.fixed.push_back(held);
}

constexpr double pressed_radius = 0.1;  // of a cylinder [m]

/// Hertz's contact of a cylinder with a plane, by its line load, and the approach of the plane to
/// the cylinder's axis (Johnson 1985, Contact mechanics, 4.2 and 5.6).
struct LineContact {
  double load;  ///< P' [N/m]

  static constexpr double modulus = E / (1 - nu * nu);  ///< E* [Pa]
  double half_width() const { return std::sqrt(4 * load * pressed_radius / (pi * modulus)); }
  /// The approach [m] of a plane to the axis.
  double approach() const {
    return load / (pi * modulus) * (2 * std::log(4 * pressed_radius / half_width()) - 1);
  }
  /// The contact whose approach is given [m].
  static LineContact with_approach(double approach) {
    double low = 0, high = E * pressed_radius;
    for (int k = 0; k < 100; ++k) {
      const double middle = 0.5 * (low + high);
      (LineContact{middle}.approach() < approach ? low : high) = middle;
    }
    return {low};
  }
};

/// Solves for a quarter of a cylinder that a plane presses, at rest by Newton's method.
Solution cylinder(const Discretisation& d) {
  constexpr double approach = 0.03 * pressed_radius;
  Scene scene;
  BodyRequest body = contact_body(d, "cylinder", nu);
  body.material.law = SmallStrain<double>::name;
  hold_along_z(body);
  for (const PlaneNormal normal : {PlaneNormal::x, PlaneNormal::y}) {
    body.symmetries.push_back({.normal = normal, .where = body.where});
  }
  scene.bodies.push_back(body);
  scene.obstacles.push_back(ram({0, -1, 0}, {0, pressed_radius, 0}, {0, -approach, 0}, 1));
  const auto find = [&](const Model& model, Backend& backend, const Solver&) {
    std::vector<Vec3d> force;
    backend.internal_forces(force);
    // At rest the internal forces of free phyxels are those of contact, with the other sign.
    double load = 0, second = 0;
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d& x = model.position[i];
      if (x.y < 0.5 * pressed_radius) continue;
      load += force[i].y, second += force[i].y * x.x * x.x;
    }
    const LineContact found{2 * load / thickness_of_slice(d, pressed_radius)};
    // A semi-ellipse of half width b has the second moment P' b²/4.
    return std::vector<Quantity>{{"force", found.load, LineContact::with_approach(approach).load},
                                 {"half width", 2 * std::sqrt(second / load), found.half_width()}};
  };
  return solve_at_rest(
      scene, [&] { return quarter_of_cylinder(d, pressed_radius); }, find);
}

/// Pulls a strap over half of a drum until all of it slides.
Solution strap(const Discretisation& d) {
  constexpr double radius = 0.1, thickness = 0.005, tail = 0.03;  // [m]
  constexpr double friction = 0.3, pulled = 0.012, duration = 0.5;
  const double spacing = thickness / d.across, slice = 2 * spacing;
  const double tension = 0.01 * E * thickness * slice;  // T₁ [N]
  Scene scene;
  BodyRequest body = contact_body(d, "strap", 0);
  body.material.damping = 10;
  body.material.viscosity = 2e-4;  // friction makes vibrations grow
  hold_along_z(body);
  const double end = -tail + 0.5 * spacing;
  body.loads.push_back({.select = {.box = Selection::Box{{0, -far, -far}, {far, end, far}}},
                        .force = {0, -tension, 0},
                        .ramp = 0.1});
  MotionRequest pull{.select = {.box = Selection::Box{{-far, -far, -far}, {0, end, far}}},
                     .displacement = {0, -pulled, 0},
                     .duration = duration};
  pull.axes = {.x = false, .y = true, .z = false};
  body.motions.push_back(pull);
  scene.bodies.push_back(body);
  ObstacleRequest drum;
  drum.name = "drum";
  drum.shape = "cylinder";
  drum.radius = radius;
  drum.length = 1;
  drum.friction = friction;
  drum.where = "phyxel accuracy";
  scene.obstacles.push_back(drum);
  Touching strap(scene,
                 [&] { return std::vector<Cloud>{strap_on_drum(d, radius, thickness, tail)}; });
  // Motions slow down towards their end, where nothing is left of inertia and damping; the means
  // are over the swings of the last tenth.
  double pull_force = 0;
  int looks = 0;
  std::vector<Vec3d> force;
  while (strap.solver().time() < duration) {
    strap.solver().step();
    if (strap.solver().time() < 0.9 * duration) continue;
    strap.backend().internal_forces(force);
    for (Index i = 0; i < strap.model().size(); ++i) {
      const Vec3d& x = strap.model().position[i];
      if (x.x < 0 && x.y < end) pull_force += force[i].y;
    }
    ++looks;
  }
  // The friction of T/R along the surface turns the strap about the axis, from which T is half a
  // thickness farther.
  const double exponent = friction * pi * radius / (radius + 0.5 * thickness);
  return strap.solution({{"ratio of tensions", pull_force / looks / tension, std::exp(exponent)}});
}

}  // namespace

std::vector<AccuracyCase> contact_cylinders() {
  return {
      {.name = "cylinder",
       .what = "A cylinder in plane strain, ν = 0.3, between two rigid planes without friction, "
               "each of which approaches its axis by 0.03 R: a quarter of it, at rest by Newton's "
               "method. Strains are small ones; the half width of contact is 0.15 R, which is 3, "
               "4.5 and 6 spacings. References: the force of that approach (Johnson 1985, Contact "
               "mechanics, 5.6), and the half width that Hertz gives for the force found, beside "
               "that from the second moment of the forces of contact.",
       .across = {40, 60, 80},
       .solve = cylinder,
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}},
      {.name = "strap",
       .what = "A strap lies on half of a drum, friction 0.3, is pulled at both ends, and slides: "
               "its tensions at the ends are in the ratio exp(0.3 π R/(R + t/2)) (Euler and "
               "Eytelwein, with friction at the surface and tension in the middle of the thickness "
               "t = R/20). Plane strain, ν = 0; Verlet's steps.",
       .across = {2, 3},
       .solve = strap,
       .closures = {0},
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = {Filling::nodes}}};
}

}  // namespace phyxel::app
