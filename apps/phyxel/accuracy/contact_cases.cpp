/// Problems of bodies that are pressed, slide and roll.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "accuracy/round_bodies.hpp"
#include "accuracy/touching.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/physics/laws.hpp"

namespace phyxel::app {
namespace {

constexpr double gravity = 9.81;  // [m/s²]

constexpr double pressed_radius = 0.1;  // of a ball [m]

/// A ball between two planes that press it: an eighth of it, and planes of symmetry.
/// @param duration of the planes' motion [s]
Scene pressed_ball(const Discretisation& d, double duration) {
  constexpr double approach = 0.04 * pressed_radius;
  Scene scene;
  BodyRequest body = contact_body(d, "ball", nu);
  body.material.law = SmallStrain<double>::name;
  for (const PlaneNormal normal : {PlaneNormal::x, PlaneNormal::y, PlaneNormal::z}) {
    body.symmetries.push_back({.normal = normal, .where = body.where});
  }
  scene.bodies.push_back(body);
  scene.obstacles.push_back(ram({0, 0, -1}, {0, 0, pressed_radius}, {0, 0, -approach}, duration));
  return scene;
}

/// Quantities of a pressed ball in its present state; references are those of finite elements.
/// @param force on the eighth of the ball [N]
std::vector<Quantity> of_pressed_ball(const Model& model, Backend& backend, Vec3d force) {
  std::vector<Mat3d> gradient;
  backend.displacement_gradients(gradient);
  // At the pole, which is the highest phyxel.
  const auto pole = std::max_element(model.position.begin(), model.position.end(),
                                     [](const Vec3d& a, const Vec3d& b) { return a.z < b.z; });
  const Mat3d stress = SmallStrain<double>{{lame_lambda(E, nu), lame_mu(E, nu)}}.first_piola_stress(
      gradient[pole - model.position.begin()]);
  // Of ball_on_planes.py.
  return {{"force", -4 * force.z, 0.01320 * E * pressed_radius * pressed_radius},
          {"pressure at the pole", -stress(2, 2), 0.1455 * E}};
}

/// Solves for the pressed ball at rest by Newton's method.
Solution hertz(const Discretisation& d) {
  return solve_at_rest(
      pressed_ball(d, 1), [&] { return eighth_of_ball(d, pressed_radius); },
      [](const Model& model, Backend& backend, const Solver& solver) {
        return of_pressed_ball(model, backend, find_contacts(model, backend, solver).at(0).force);
      });
}

/// Solves for the pressed ball by damped Verlet steps.
Solution hertz_by_steps(const Discretisation& d) {
  constexpr double duration = 0.05;  // four periods of the ball's slowest mode [s]
  Scene scene = pressed_ball(d, duration);
  scene.bodies[0].material.damping = 500;  // half of critical for that mode
  Touching ball(scene, [&] { return std::vector<Cloud>{eighth_of_ball(d, pressed_radius)}; });
  while (ball.solver().time() < 1.6 * duration) ball.solver().step();
  const Vec3d force = find_contacts(ball.model(), ball.backend(), ball.solver()).at(0).force;
  return ball.solution(of_pressed_ball(ball.model(), ball.backend(), force));
}

/// Simulates a ball that slides on a plane until it rolls.
Solution rolling(const Discretisation& d) {
  constexpr double radius = 0.1, speed = 1, friction = 0.2;
  constexpr double rolls = 2 * speed / (7 * friction * gravity);  // [s]
  Scene scene;
  scene.gravity = {0, 0, -gravity};
  scene.bodies.push_back(contact_body(d, "ball", nu));
  scene.bodies[0].velocity = {speed, 0, 0};
  scene.bodies[0].material.young = 30 * E;  // it sinks by a five-hundredth of its radius
  scene.obstacles.push_back(plane("floor", {0, 0, 1}, {0, 0, -radius}, friction));
  Touching ball(scene, [&] { return std::vector<Cloud>{ball_cloud(d, radius)}; });
  const double inertia = 0.4 * ball.model().parts[0].mass * radius * radius;
  // The spring of the contact, which friction has loaded, swings on while the ball rolls: means
  // over several periods.
  double moves = 0, turns = 0;
  int looks = 0;
  while (ball.solver().time() < 1.5 * rolls) {
    ball.solver().step();
    if (ball.solver().time() < rolls) continue;
    moves += ball.velocity(0).x;
    turns += ball.turning(0).y / inertia * radius;
    ++looks;
  }
  const double final_speed = 5.0 / 7 * speed;
  return ball.solution({{"speed", moves / looks, final_speed},
                        {"speed of the surface", turns / looks, final_speed},
                        {"way", ball.moved(0).x,
                         12 * speed * speed / (49 * friction * gravity) +
                             final_speed * (ball.solver().time() - rolls)}});
}

constexpr double block_side = 0.2, angle = std::numbers::pi / 6, slope_friction = 0.3;
constexpr double slope_speed = 0.5;  ///< At the start: above those of the block's vibrations [m/s].

/// Simulates a block that slides down an inclined plane. Gravity is turned instead of the plane.
Solution slope(const Discretisation& d) {
  Scene scene;
  scene.gravity = gravity * Vec3d{std::sin(angle), 0, -std::cos(angle)};
  scene.bodies.push_back(contact_body(d, "block", nu));
  scene.bodies[0].velocity = {slope_speed, 0, 0};
  scene.bodies[0].material.viscosity = 1e-4;  // friction makes vibrations grow
  scene.obstacles.push_back(plane("slope", {0, 0, 1}, {0, 0, -0.5 * block_side}, slope_friction));
  Touching block(scene, [&] {
    return std::vector<Cloud>{
        block_cloud(d, {block_side, block_side, block_side}, block_side / d.across)};
  });
  constexpr double end = 0.5;  // [s]
  while (block.solver().time() < end) block.solver().step();
  const double time = block.solver().time();
  const double pull = gravity * (std::sin(angle) - slope_friction * std::cos(angle));
  return block.solution({{"way", block.moved(0).x, slope_speed * time + 0.5 * pull * time * time}});
}

/// Simulates two blocks, one on the other, that planes press. Their clouds do not match.
Solution pressed_blocks(const Discretisation& d) {
  constexpr double width = 0.4, height = 0.2, approach = 1e-3 * 2 * height;
  const double stress = E * approach / (2 * height);
  Scene scene;
  scene.bodies = {contact_body(d, "lower", 0), contact_body(d, "upper", 0)};
  for (BodyRequest& body : scene.bodies) {
    body.material.law = SmallStrain<double>::name;
    body.material.damping = 100;  // of the first mode: about critical
  }
  scene.contact.emplace();
  scene.obstacles = {plane("table", {0, 0, 1}, {0, 0, -height}),
                     ram({0, 0, -1}, {0, 0, height}, {0, 0, -approach}, 0.1)};
  Touching blocks(scene, [&] {
    const Vec3d size{width, width, height};
    const double spacing = height / d.across;
    return std::vector<Cloud>{
        moved_cloud(block_cloud(d, size, spacing), {0, 0, -0.5 * height}),
        moved_cloud(block_cloud(d, size, 0.8 * spacing), {0, 0, 0.5 * height})};
  });
  while (blocks.solver().time() < 0.25) blocks.solver().step();
  const double force =
      find_contacts(blocks.model(), blocks.backend(), blocks.solver()).at(0).force.z;
  std::vector<Mat3d> gradient;
  blocks.backend().displacement_gradients(gradient);
  // On both faces that touch; Poisson's ratio is 0.
  double worst = 0, inner = 0, squares = 0, volume = 0;
  for (Index i = 0; i < blocks.model().size(); ++i) {
    const Vec3d x = blocks.model().position[i];
    if (std::abs(x.z) > 1e-6 * height) continue;
    const double error = std::abs(-E * gradient[i](2, 2) / stress - 1);
    const double v = blocks.model().volume[i];
    worst = std::max(worst, error);
    squares += v * error * error;
    volume += v;
    const double from_edge = 0.5 * width - std::max(std::abs(x.x), std::abs(x.y));
    if (from_edge > 0.25 * height) inner = std::max(inner, error);
  }
  return blocks.solution({{"mean pressure", force / (width * width), stress},
                          {"root mean square error of the pressure", std::sqrt(squares / volume)},
                          {"largest error of the pressure", worst},
                          {"largest error away from edges", inner}});
}

}  // namespace

std::vector<AccuracyCase> contact_cases() {
  std::vector<AccuracyCase> cases{
      {.name = "hertz",
       .what =
           "A ball, ν = 0.3, between two rigid planes without friction, each of which approaches "
           "its centre by 0.04 R: an eighth of the ball, at rest by Newton's method. Strains are "
           "small ones; the radius of contact is 0.2 R, which is 2, 3 and 4 spacings. References: "
           "the force on a plane and the pressure at the pole by quadratic axisymmetric finite "
           "elements of the same ball (`bench/references/ball_on_planes.py`; ± 0.05%). The force "
           "of Hertz, whose bodies are infinite, is 11% less, and his pressure 4% less. The force "
           "is too small, by an error of about first order in the spacing: at rest, a surface "
           "feels a force only as deep in the plane as that. The pressure at the pole is that of a "
           "single phyxel; its error does not shrink at these sizes.",
       .across = {20, 30, 40},
       .solve = hertz,
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}}};
  cases.push_back(
      {.name = "hertz-steps",
       .what =
           "The same ball by Verlet's steps, whose contact needs no depth: the planes arrive after "
           "four periods of the ball's slowest vibration, half of whose critical damping it has. "
           "The error of the force on nodes is half of that at rest. A mesh's phyxels lie on "
           "triangles as wide as a spacing, which cut off what is round: an error of second order "
           "in both cases.",
       .across = {20, 30, 40},
       .solve = hertz_by_steps,
       .closures = {0},
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}});
  for (AccuracyCase& impact : contact_impacts()) cases.push_back(std::move(impact));
  cases.push_back(
      {.name = "rolling",
       .what =
           "A ball slides on a plane with friction until it rolls, at 5/7 of its speed. The speeds "
           "of its centre and, relative to that, of its surface are means over half of the time "
           "that a rigid ball needs until it rolls, after that time; the way is that of the centre "
           "at the end. The ball is so hard that the radius of contact is less than a spacing: it "
           "rolls on single phyxels, and loses speed where it falls from one to the next. A "
           "softer one rolls at another speed than a rigid one: its surface is compressed where it "
           "touches.",
       .across = {8, 12, 16},
       .solve = rolling,
       .closures = {0},
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = {Filling::cells, Filling::mesh}});
  cases.push_back(
      {.name = "slope",
       .what =
           "A block slides down an inclined plane for half a second: friction 0.3, 30°. It starts "
           "at 0.5 m/s, so that all its points slide although its own weight, which acts at once, "
           "makes it swing; its viscosity damps the vibrations that friction makes grow. "
           "Reference: v t + ½ g (sin 30° - 0.3 cos 30°) t². The difference that remains is that "
           "of a block which its weight compresses, and so it has no order.",
       .across = {4, 6, 8},
       .solve = slope,
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}});
  cases.push_back(
      {.name = "pressed-blocks",
       .what =
           "The contact patch test: two blocks, ν = 0, one on the other, are pressed by 0.1% "
           "between planes, and come to rest by damping. The spacing of one is 5/4 of the other's. "
           "The mean pressure is that on a plane; errors of the pressure are those of the normal "
           "stress in the phyxels of both faces that touch, relative to the uniform stress. Away "
           "from edges: phyxels more than a quarter of a block's height from them. The mean is "
           "right within some parts in a thousand, but on irregular clouds without closed "
           "gradients; pressures of single phyxels are not, above all at edges and corners, and on "
           "irregular clouds they do not converge at these sizes.",
       .across = {4, 6, 8},
       .solve = pressed_blocks,
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}});
  for (AccuracyCase& c : contact_cylinders()) cases.push_back(std::move(c));
  for (AccuracyCase& c : cases) c.group = "contact";
  return cases;
}

}  // namespace phyxel::app
