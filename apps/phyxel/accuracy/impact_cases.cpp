/// Taylor's bar: a rod of copper that strikes a wall.
#include <algorithm>
#include <cmath>
#include <utility>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "accuracy/round_bodies.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/solver.hpp"
#include "phyxel/step_control.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

constexpr double radius = 3.2e-3, length = 32.4e-3;  // [m]
constexpr double speed = 227, end_time = 80e-6;      // [m/s, s]

Scene copper(const Discretisation& d) {
  BodyRequest body;
  body.name = "rod";
  body.where = "phyxel accuracy";
  body.material = {.young = 117e9,
                   .poisson = 0.35,
                   .density = 8930,
                   .law = J2<double>::name,
                   .parameters = {{"yield_stress", 0.4e9}, {"hardening", 0.1e9}},
                   .hourglass = d.hourglass};
  body.neighbourhood.factor = d.factor;
  body.closure = d.closure;
  body.velocity = {0, 0, -speed};
  // A wall without friction: the foot stays in its plane.
  body.fixed.push_back({.select = {.region = "z-"}, .axes = {.x = false, .y = false, .z = true}});
  Scene scene;
  scene.bodies.push_back(body);
  scene.time.end = end_time;
  // The energy of waves as steep as those of an impact is known to (ω Δt)²/8: at 0.8 of the largest
  // step, 0.3% of all energy on 2,501 phyxels.
  scene.time.safety = 0.3;
  scene.output.frames_per_second = 0;
  scene.solver.precision = Precision::double_;
  return scene;
}

/// A point of the body's surface, at rest and now [m].
struct SurfacePoint {
  Vec3d rest, now;
};
/// The points of a body's surface: its phyxels, or its surfels where phyxels lie in cells.
std::vector<SurfacePoint> surface_points(const Model& model, Backend& backend, Filling filling) {
  std::vector<SurfacePoint> points;
  if (filling == Filling::cells) {
    SurfelState surfels;
    backend.advect_surfels(surfels);
    for (std::size_t s = 0; s < surfels.position.size(); ++s) {
      points.push_back({model.surfels.position[s], surfels.position[s]});
    }
  } else {
    State state;
    backend.download(state);
    for (Index i = 0; i < model.size(); ++i) {
      points.push_back({model.position[i], model.position[i] + state.displacement[i]});
    }
  }
  return points;
}

Solution taylor(const Discretisation& d) {
  const auto begin = Clock::now();
  const Scene scene = copper(d);
  const Cloud cloud = rod(d, radius, length);
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_cpu_backend(model, Precision::double_);
  StepPlan plan = plan_steps(scene, model, *backend);
  Solver solver(model, *backend, initial_state(model, scene, plan.dt), Method::verlet);
  StepControl control(model, *backend, plan);
  Solution solution{.phyxels = model.size(),
                    .neighbours = static_cast<double>(model.pairs()) / model.size(),
                    .setup_seconds = seconds_since(begin)};
  const auto start = Clock::now();
  const Diagnostics before = diagnose(model, *backend, solver);
  while (solver.steps() < plan.steps) {
    plan.halve(control.look(solver, plan.halvings));
    const std::int64_t until = std::min(plan.steps, control.next_look(solver));
    solution.evaluations += until - solver.steps();
    solver.step(until - solver.steps());
  }
  solution.seconds = seconds_since(start);
  const Diagnostics after = diagnose(model, *backend, solver);

  double top = 0, foot = 0, spread = 0, strain = 0;
  int at_top = 0, at_foot = 0;
  constexpr double near = 1e-6 * length;
  for (const SurfacePoint& p : surface_points(model, *backend, d.filling)) {
    if (p.rest.z > length - near) top += p.now.z, ++at_top;
    if (p.rest.z < near) {
      foot += p.now.z, ++at_foot;
      spread = std::max(spread, std::hypot(p.now.x, p.now.y));
    }
  }
  const State state = solver.state();
  for (const HistoryColumn& column : state.history) {
    if (column.name != "equivalent_plastic_strain") continue;
    strain = *std::max_element(column.values.begin(), column.values.end());
  }
  solution.found = {{"length in mm", 1e3 * (top / at_top - foot / at_foot), 21.46},
                    {"radius of the foot in mm", 1e3 * spread, 7.105},
                    {"largest plastic strain", strain, 2.86},
                    {"energy", after.total_energy(), before.total_energy()}};
  return solution;
}

}  // namespace

std::vector<AccuracyCase> impact_cases() {
  return {
      {.name = "taylor",
       .what =
           "Taylor's bar: a copper rod (32.4 mm long, 6.4 mm across; E 117 GPa, ν 0.35, ρ 8930 "
           "kg/m³, yield stress 0.4 GPa, linear hardening 0.1 GPa) strikes a frictionless wall at "
           "227 m/s; it is simulated for 80 µs. References: midpoints of the published ranges, "
           "length 21.26 to 21.66 mm, radius of the foot 6.97 to 7.24 mm, largest plastic strain "
           "2.47 to 3.25 (Kamoulakos 1990; Zhu and Cescotto 1995; Camacho and Ortiz 1997; "
           "tabulated by Li, Habbal and Ortiz 2010), quoted from memory: errors below 0.9%, 1.9% "
           "and 14% lie within these ranges. Energy: the sum of kinetic, elastic and hourglass "
           "energy and plastic work at the end, compared with the start.",
       .across = {8, 12, 20},
       .solve = taylor,
       .closures = {0},
       .jitters = {0},
       .hourglass = {0.1}}};
}

}  // namespace phyxel::app
