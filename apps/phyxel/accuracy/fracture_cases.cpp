/// Problems of fracture: what a crack releases at rest, and where one runs.
#include <cmath>
#include <numbers>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "accuracy/touching.hpp"
#include "phyxel/diagnostics.hpp"

namespace phyxel::app {
namespace {

constexpr double far = 100;                    // beyond all bodies [m]
constexpr double modulus = E / (1 - nu * nu);  // E′ of plane strain [Pa]

/// A plate in plane strain that is cut along y = 0 from its edge at x = 0.
struct CrackedPlate {
  double length, height;  ///< [m]
  double spacing;         ///< [m]

  double thickness() const { return 2 * spacing; }

  /// The body, whose lower left corner is at (0, -height/2).
  BodyRequest body(const Discretisation& d, const char* name, double crack) const {
    BodyRequest body = contact_body(d, name, nu);
    body.material.law = SmallStrain<double>::name;
    FixRequest held = fix(Selection::Box{{-far, -far, -far}, {far, far, far}});
    held.axes = {.x = false, .y = false, .z = true};
    body.fixed.push_back(held);
    // A disc so large that its edge is straight where it ends in the plate.
    const double radius = 1e3 * length;
    body.notches.push_back({.centre = {crack - radius, 0, 0},
                            .normal = {0, 1, 0},
                            .radius = radius,
                            .where = body.where});
    return body;
  }
  Cloud cloud(const Discretisation& d) const {
    return moved_cloud(block_cloud(d, {length, height, thickness()}, spacing),
                       {0.5 * length, 0, 0});
  }
  static FixRequest fix(Selection::Box box) { return {.select = {.box = box}}; }
};

/// A plate at rest: its energy, and the force on its loaded end.
struct PlateAtRest {
  double energy = 0;  ///< Of deformation [J].
  double force = 0;   ///< Along y, of the internal forces of a selection [N].
  Solution solution;
};

/// Solves for a plate at rest. @param counts true for the places whose forces along y are summed
template <class Counts>
PlateAtRest rest_of(const CrackedPlate& plate, const Discretisation& d, const BodyRequest& body,
                    Counts&& counts) {
  Scene scene;
  scene.bodies.push_back(body);
  PlateAtRest rest;
  rest.solution = solve_at_rest(
      scene, [&] { return plate.cloud(d); },
      [&](const Model& model, Backend& backend, const Solver& solver) {
        std::vector<Vec3d> force;
        backend.internal_forces(force);
        for (Index i = 0; i < model.size(); ++i) {
          if (counts(model.position[i])) rest.force += force[i].y;
        }
        rest.energy = diagnose(model, backend, solver).elastic_energy();
        return std::vector<Quantity>{};
      });
  return rest;
}

/// The solution of a problem that is solved with a crack and with a longer one.
Solution of_both(const PlateAtRest& first, const PlateAtRest& second, std::vector<Quantity> found) {
  Solution all = first.solution;
  all.evaluations += second.solution.evaluations;
  all.seconds += second.solution.seconds;
  all.setup_seconds += second.solution.setup_seconds;
  all.found = std::move(found);
  return all;
}

/// A strip between grips, with a crack that grows by two spacings.
Solution strip(const Discretisation& d) {
  const CrackedPlate plate{4, 1, 1.0 / d.across};
  const double edge = 0.5 * plate.spacing, strain = 1e-3;
  const auto with_crack = [&](double crack) {
    BodyRequest body = plate.body(d, "strip", crack);
    for (const double side : {1.0, -1.0}) {
      // The outer layer of phyxels, which lies half a spacing inside if these are in cells.
      const double layer = 0.5 * plate.height - (d.filling == Filling::cells ? edge : 0);
      Selection::Box box{{-far, layer - 0.1 * edge, -far}, {far, far, far}};
      if (side < 0) box = {{-far, -far, -far}, {far, -layer + 0.1 * edge, far}};
      MotionRequest grip{
          .select = {.box = box}, .displacement = {0, side * strain * layer, 0}, .duration = 1e-12};
      grip.axes = {.x = true, .y = true, .z = false};
      body.motions.push_back(grip);
    }
    return rest_of(plate, d, body, [](Vec3d) { return false; });
  };
  const double growth = 2 * plate.spacing, crack = 0.4 * plate.length;
  const PlateAtRest before = with_crack(crack), after = with_crack(crack + growth);
  const double released = (before.energy - after.energy) / (growth * plate.thickness());
  const double in_strain = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu));
  return of_both(
      before, after,
      {{"energy release rate", released, 0.5 * in_strain * strain * strain * plate.height}});
}

/// A double cantilever whose ends are moved apart. Moments of its arms are those of forces at the
/// first layer of phyxels.
Solution double_cantilever(const Discretisation& d) {
  const double arm = 1, crack = 5 * arm;
  const CrackedPlate plate{10 * arm, 2 * arm, arm / d.across};
  const double opening = 0.02 * arm;
  const double place = d.filling == Filling::cells ? 0.5 * plate.spacing : 0;
  const auto with_crack = [&](double length) {
    BodyRequest body = plate.body(d, "double cantilever", length);
    for (const double side : {1.0, -1.0}) {
      const double low = side > 0 ? 0 : -far, high = side > 0 ? far : 0;
      MotionRequest end{.select = {.box = Selection::Box{{-far, low, -far},
                                                         {place + 0.1 * plate.spacing, high, far}}},
                        .displacement = {0, 0.5 * side * opening, 0},
                        .duration = 1e-12};
      end.axes = {.x = false, .y = true, .z = false};
      body.motions.push_back(end);
    }
    FixRequest held =
        CrackedPlate::fix({{plate.length - plate.spacing, -far, -far}, {far, far, far}});
    held.axes = {.x = true, .y = false, .z = false};
    body.fixed.push_back(held);
    return rest_of(plate, d, body,
                   [&](Vec3d x) { return x.x < place + 0.1 * plate.spacing && x.y > 0; });
  };
  const double growth = 2 * plate.spacing;
  const PlateAtRest before = with_crack(crack), after = with_crack(crack + growth);
  const double released = (before.energy - after.energy) / (growth * plate.thickness());
  const double force = 0.5 * std::abs(before.force + after.force) / plate.thickness();
  const double length = crack + 0.5 * growth - place + 0.64 * arm;
  const double reference = 12 * force * force * length * length / (modulus * arm * arm * arm);
  return of_both(before, after, {{"energy release rate", released, reference}});
}

/// A compact tension specimen under forces at its two holes.
Solution compact_tension(const Discretisation& d) {
  const double width = 1, behind = 0.25 * width, crack = 0.5 * width;
  const CrackedPlate plate{1.25 * width, 1.2 * width, width / d.across};
  const double load = 1e-3 * E * width * plate.thickness();
  const auto with_crack = [&](double length) {
    BodyRequest body = plate.body(d, "compact tension", behind + length);
    for (const double side : {1.0, -1.0}) {
      const double reach = 0.0625 * width, at = 0.275 * side * width;
      body.loads.push_back({.select = {.box = Selection::Box{{behind - reach, at - reach, -far},
                                                             {behind + reach, at + reach, far}}},
                            .force = {0, side * load, 0}});
    }
    // The middle of the far edge, by which the specimen neither moves nor turns.
    const double edge = plate.length - 0.75 * plate.spacing, middle = 0.75 * plate.spacing;
    FixRequest held = CrackedPlate::fix({{edge, -middle, -far}, {far, middle, far}});
    held.axes = {.x = true, .y = true, .z = false};
    body.fixed.push_back(held);
    return rest_of(plate, d, body, [](Vec3d) { return false; });
  };
  const double growth = 2 * plate.spacing;
  const PlateAtRest before = with_crack(crack - 0.5 * growth),
                    after = with_crack(crack + 0.5 * growth);
  // Forces that stay take twice the energy that the specimen stores.
  const double released = (after.energy - before.energy) / (growth * plate.thickness());
  constexpr double factor = 9.66;
  return of_both(before, after,
                 {{"stress intensity", std::sqrt(released * modulus),
                   load / (plate.thickness() * std::sqrt(width)) * factor}});
}

/// Kalthoff and Winkler's plate, the upper half in plane strain: an edge is struck below a notch.
Solution struck_plate(const Discretisation& d) {
  constexpr double side = 0.1, notch = 0.05, height_of_notch = 0.025;  // [m]
  constexpr double end = 60e-6;                                        // [s]
  const double spacing = side / d.across;
  Scene scene;
  BodyRequest body = contact_body(d, "plate", nu);
  body.material.young = 190e9;
  body.material.density = 8000;
  body.fracture = FractureRequest{.energy_release_rate = 22130, .where = body.where};
  const Selection::Box all{{-far, -far, -far}, {far, far, far}};
  body.fixed.push_back({.select = {.box = all}, .axes = {.x = false, .y = false, .z = true}});
  body.symmetries.push_back({.normal = PlaneNormal::y, .where = body.where});
  // Between two layers of phyxels at the nodes of a lattice.
  const double at = spacing * (std::round(height_of_notch / spacing) + 0.5);
  body.notches.push_back(
      {.centre = {0, at, 0}, .normal = {0, 1, 0}, .radius = notch, .where = body.where});
  body.motions.push_back(
      {.select = {.box = Selection::Box{{-far, -far, -far}, {0.25 * spacing, at, far}}},
       .velocity = {16.5, 0, 0},
       .axes = {.x = true, .y = false, .z = false}});
  scene.bodies.push_back(body);
  Touching plate(scene, [&] {
    const Cloud block = block_cloud(d, {side, side, 2 * spacing}, spacing);
    return std::vector<Cloud>{moved_cloud(block, {0.5 * side, 0.5 * side, 0})};
  });
  // True once the crack is more than a spacing longer than the notch.
  const auto grows = [&] {
    for (const PhyxelPair& pair : plate.solver().state().broken) {
      const std::vector<Vec3d>& x = plate.model().position;
      const Vec3d middle = 0.5 * (x[pair[0]] + x[pair[1]]);
      if (middle.x > notch + 1.5 * spacing && middle.x < notch + 10 * spacing) return true;
    }
    return false;
  };
  double begins = 0;
  while (plate.solver().time() < end) {
    plate.solver().step(5);
    if (begins == 0 && grows()) begins = plate.solver().time();
  }
  // The farthest phyxel of the crack: one that has lost a third of its pairs.
  const Breakage breakage = plate.backend().breakage().value();
  Vec3d tip{notch, at, 0};
  for (Index i = 0; i < plate.model().size(); ++i) {
    const Vec3d& x = plate.model().position[i];
    if (breakage.broken[i] > 1.0 / 3 && x.x > 0.9 * notch && x.y > tip.y) tip = x;
  }
  const double angle = std::atan2(tip.y - at, tip.x - notch) * 180 / std::numbers::pi;
  return plate.solution(
      {{"angle of the crack", angle, 67.5}, {"begin of the crack", begins, 28e-6}});
}

}  // namespace

std::vector<AccuracyCase> fracture_cases() {
  std::vector<AccuracyCase> cases{
      {.name = "strip",
       .what = "A long strip in plane strain between grips that are moved apart, with a crack from "
               "one end: the energy that it loses, by area, while the crack grows by two spacings. "
               "Reference: the energy of the strip far ahead of the crack (Rice 1967).",
       .across = {16, 24, 32},
       .solve = strip},
      {.name = "double-cantilever",
       .what =
           "Two arms in plane strain, five times as long as high, whose ends are moved apart: "
           "the energy that they lose while the crack between them grows by two spacings. "
           "Reference: 12 P² (a + 0.64 h)²/(E′ h³), with the force P that was found (a beam on an "
           "elastic foundation, Kanninen 1973).",
       .across = {6, 8, 12},
       .solve = double_cantilever},
      {.name = "compact-tension",
       .what = "A compact tension specimen in plane strain whose crack is half as long as it is "
               "wide: K from the energy that it stores while the crack grows by two spacings under "
               "forces that stay. Reference: 9.66 P/(B √W) (ASTM E399).",
       .across = {20, 30, 40},
       .solve = compact_tension},
      {.name = "struck-plate",
       .what =
           "A plate of steel with two notches, struck between them, the upper half in plane "
           "strain: the angle [degrees] at which the crack has left the tip of the notch after "
           "60 µs, and when it begins [s]. References: 65 to 70 degrees in experiments (Kalthoff "
           "2000), and 26 to 30 µs in simulations (Song, Wang and Belytschko 2008).",
       .across = {50, 100},
       .solve = struck_plate}};
  for (AccuracyCase& c : cases) {
    c.group = "fracture";
    c.closures = {0};
    c.hourglass = {0.1};
    c.fillings = {Filling::cells, Filling::mesh};
    if (c.name == "struck-plate") c.fillings = {Filling::nodes, Filling::mesh};
  }
  return cases;
}

}  // namespace phyxel::app
