#include "accuracy/hard_cases.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "accuracy/bar.hpp"
#include "accuracy/trial.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/laws.hpp"
#include "setup.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

using Placement = ShapeRequest::Placement;

/// The most accurate discretisation: nodes, closed gradients, hourglass control (docs/accuracy.md).
constexpr Discretisation best{
    .filling = Filling::nodes, .hourglass = 0.1, .closure = 1e-3, .across = 6};

Cloud box_of(int nx, int ny, int nz, double spacing) {
  Cloud cloud;
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        cloud.position.push_back({spacing * x, spacing * y, spacing * z});
        cloud.volume.push_back(spacing * spacing * spacing);
      }
    }
  }
  return cloud;
}
Scene scene_of(const char* law = StVenantKirchhoff<double>::name) {
  BodyRequest body;
  body.name = "body";
  body.where = "phyxel accuracy";
  body.material = {.young = E, .poisson = nu, .density = rho, .law = law, .hourglass = 0};
  Scene scene;
  scene.bodies.push_back(body);
  return scene;
}

// --- Poisson's ratio -----------------------------------------------------------------------------

/// Relative error of the sag of the clamped bar of the case `gravity`.
/// @param reference sag by finite elements with quadratic displacements and linear pressure, on
/// meshes
///   graded towards the clamped face up to 40 × 16 × 16, extrapolated: known to 0.003% [m]
double sag_error(double poisson, double reference, const Machine& machine) {
  Scene scene = clamped(bar(best, 1, 0.2, poisson));
  scene.gravity = {0, 0, -0.1};
  Trial trial(scene, machine);
  const Equilibrium found = trial.rest();
  const double sag = mean_of(trial.model(), trial.region("x+"), found.state.displacement).z;
  return std::abs(sag / reference - 1);
}
double sag_auxetic(const Machine& m) { return sag_error(-0.5, -3.61933e-3, m); }
double sag_0(const Machine& m) { return sag_error(0, -3.86931e-3, m); }
double sag_049(const Machine& m) { return sag_error(0.49, -3.7399e-3, m); }
double sag_0499(const Machine& m) { return sag_error(0.499, -3.7329e-3, m); }
double sag_04999(const Machine& m) { return sag_error(0.4999, -3.7322e-3, m); }

// --- shapes --------------------------------------------------------------------------------------

/// Energy drift of a cloud without bending stiffness that swings under its weight.
double swing(Cloud cloud, const Machine& machine) {
  Scene scene = scene_of();
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].neighbourhood.radius = 0.09;
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -9, -9}, {0.01, 9, 9}}}});
  Trial trial(scene, {std::move(cloud)}, machine);
  if (trial.model().warnings.empty()) return HUGE_VAL;  // a warning is required
  const double dt = trial.step_at(0.5);
  Drift drift;
  trial.run(trial.at_rest(dt), 50, static_cast<std::int64_t>(1 / dt),
            [&](const State&, const Diagnostics& now) { drift.look(trial.first(), now); });
  return drift.share();
}
double sheet(const Machine& machine) { return swing(box_of(21, 11, 1, 0.05), machine); }
double thread(const Machine& machine) { return swing(box_of(41, 1, 1, 0.05), machine); }

double single_phyxel(const Machine& machine) {
  Cloud cloud = box_of(1, 1, 1, 0.1);
  Scene scene = scene_of();
  scene.bodies[0].neighbourhood.radius = 0.2;
  Trial trial(scene, {cloud}, machine);
  return trial.step_at(0.5);
}

/// A block and a phyxel out of its reach, which falls freely.
double lone_phyxel(const Machine& machine) {
  Cloud cloud = box_of(4, 4, 4, 0.1);
  cloud.position.push_back({5, 0, 0});
  cloud.volume.push_back(1e-3);
  Scene scene = scene_of();
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].neighbourhood.radius = 0.18;
  Trial trial(scene, {cloud}, machine);
  const double dt = trial.step_at(0.5);
  const auto steps = static_cast<std::int64_t>(0.5 / dt);
  double error = 0;
  trial.run(trial.at_rest(dt), 1, steps, [&](const State& state, const Diagnostics& now) {
    error = std::abs(state.displacement.back().z / (-0.5 * 9.81 * now.time * now.time) - 1);
  });
  return error;
}

/// A spinning block with coincident and nearly coincident phyxels.
double coincident(const Machine& machine) {
  Cloud cloud = box_of(5, 5, 5, 0.1);
  cloud.position[31] = cloud.position[32];
  cloud.position[62] = cloud.position[63] + Vec3d{1e-12, 0, 0};
  cloud.position[93] = cloud.position[94] + Vec3d{0, 1e-6, 1e-6};
  Scene scene = scene_of();
  scene.bodies[0].spin = {1, 2, 3};
  Trial trial(scene, {cloud}, machine);
  if (trial.model().degenerate.coincident.empty()) return HUGE_VAL;
  const double dt = trial.step_at(0.5);
  Drift drift;
  trial.run(trial.at_rest(dt), 50, 2000,
            [&](const State&, const Diagnostics& now) { drift.look(trial.first(), now); });
  return drift.share();
}

/// A cube with a spacing ten times smaller in its middle than at its faces. The outer phyxels
/// follow an affine motion, which the inner ones should follow, too.
double graded(const Machine& machine) {
  constexpr int half = 5;
  Cloud cloud;
  for (int z = -half; z <= half; ++z) {
    for (int y = -half; y <= half; ++y) {
      for (int x = -half; x <= half; ++x) {
        const Vec3d at{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
        const double r = std::max({std::abs(at.x), std::abs(at.y), std::abs(at.z)}) / half;
        // Spacings grow with the distance from the middle, from 1 to 10.
        const double stretch = 0.1 + 0.45 * r;
        cloud.position.push_back((stretch / half) * at);
        const double s = stretch / half;
        cloud.volume.push_back(s * s * (s + 0.45 * r / half));
      }
    }
  }
  Scene scene = scene_of();
  scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  Mat3d g;
  for (int e = 0; e < 9; ++e) g(e / 3, e % 3) = 1e-3 * std::sin(1.0 + e);
  Trial trial(scene, {cloud}, machine);
  State state = trial.at_rest(trial.step_at(0.5));
  for (Index i = 0; i < trial.model().size(); ++i) {
    state.displacement[i] = g * trial.model().position[i];
  }
  trial.backend().upload(state);
  std::vector<Mat3d> gradient;
  trial.backend().displacement_gradients(gradient);
  double worst = 0;
  for (const Mat3d& found : gradient) {
    for (int e = 0; e < 9; ++e) {
      worst = std::max(worst, std::abs(found(e / 3, e % 3) - g(e / 3, e % 3)) / 1e-3);
    }
  }
  // The released cube must ring stably.
  Drift drift;
  trial.run(state, 50, 2000,
            [&](const State&, const Diagnostics& now) { drift.look(trial.first(), now); });
  return std::max(worst, drift.share());
}

// --- materials -----------------------------------------------------------------------------------

double contrast(const Machine& machine) {
  Discretisation d = best;
  d.across = 3;
  Scene scene = bar(d, 1.2, 0.3, 0);
  scene.bodies[0].closure = 1e-6;
  Material hard = scene.bodies[0].material;
  hard.young *= 1e6;
  scene.bodies[0].inclusions.push_back(
      {.select = {.box = Selection::Box{{0.61, -1, -1}, {2, 1, 1}}}, .material = hard});
  scene.bodies[0].fixed.push_back({.select = {.region = "x-"}});
  scene.bodies[0].motions.push_back(
      {.select = {.region = "x+"}, .displacement = {6e-6, 0, 0}, .duration = 1});
  Trial trial(scene, machine);
  const Equilibrium found = trial.rest();
  double joint = 0, joined = 0;
  for (Index i = 0; i < trial.model().size(); ++i) {
    if (std::abs(trial.model().position[i].x - 0.6) > 1e-9) continue;
    joint += found.state.displacement[i].x;
    ++joined;
  }
  return std::abs(joint / joined / 6e-6 - 1);
}

// --- large deformation ---------------------------------------------------------------------------

Scene block(const char* law, double damping) {
  Scene scene;
  BodyRequest body;
  body.name = "block";
  body.where = "phyxel accuracy";
  body.source.shape = {.name = "block",
                       .size = {0.4, 0.4, 0.4},
                       .spacing = 0.1,
                       .placement = Placement::nodes,
                       .surface = false};
  body.material = {
      .young = E, .poisson = nu, .density = rho, .law = law, .damping = damping, .hourglass = 0.1};
  scene.bodies.push_back(body);
  return scene;
}

/// Elastic energy that remains when a released block has come to rest, relative to the first.
double sprung_back(const char* law, double safety, const std::function<Vec3d(Vec3d)>& start,
                   const Machine& machine) {
  Trial trial(block(law, 30), machine);
  const double dt = trial.step_at(safety);
  State state = trial.at_rest(dt);
  for (Index i = 0; i < trial.model().size(); ++i) {
    state.displacement[i] = start(trial.model().position[i]);
  }
  Diagnostics last;
  trial.run(state, 400, static_cast<std::int64_t>(2 / dt),
            [&](const State&, const Diagnostics& now) { last = now; });
  if (last.inverted > 0) {
    throw Error(ExitCode::diverged,
                std::to_string(last.inverted) + " phyxels are inside out (det F <= 0) at the end");
  }
  return last.elastic_energy() / trial.first().elastic_energy();
}
Vec3d flattened(Vec3d x) { return {-0.9 * x.x, 0, 0}; }
double flattened_hooke(const Machine& m) {
  return sprung_back(StVenantKirchhoff<double>::name, 0.8, flattened, m);
}
double flattened_neo(const Machine& m) {
  return sprung_back(NeoHookean<double>::name, 0.2, flattened, m);
}
double flattened_corotated(const Machine& m) {
  return sprung_back(Corotated<double>::name, 0.8, flattened, m);
}
/// A mirror image with random displacements of a hundredth spacing, which break the symmetry.
Vec3d mirrored(Vec3d x) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(1e6 * (x.x + 7 * x.y + 49 * x.z + 100)));
  const auto jolt = [&] { return 1e-3 * (static_cast<double>(engine() >> 11) * 0x1p-52 - 1); };
  const double a = jolt(), b = jolt();
  return {-2 * x.x + a, b, jolt()};
}
double inside_out_neo(const Machine& m) {
  return sprung_back(NeoHookean<double>::name, 0.2, mirrored, m);
}
double inside_out_corotated(const Machine& m) {
  return sprung_back(Corotated<double>::name, 0.4, mirrored, m);
}

/// A column stretched by a fifth, so that it does not buckle into a helix, with one end turned
/// three times: its middle must turn by half of that, by symmetry.
double twist(const Machine& machine) {
  Scene scene = clamped(bar({.filling = Filling::nodes, .hourglass = 0.1, .across = 3}, 1, 0.1));
  scene.bodies[0].material.law = NeoHookean<double>::name;
  scene.bodies[0].motions.push_back({.select = {.region = "x+"},
                                     .displacement = {0.2, 0, 0},
                                     .rotation = {3 * 360, 0, 0},
                                     .duration = 1});
  Trial trial(scene, machine);
  const State found = trial.rest().state;
  double turned = 0, count = 0;
  for (Index i = 0; i < trial.model().size(); ++i) {
    const Vec3d& x = trial.model().position[i];
    const double r = std::hypot(x.y, x.z);
    if (std::abs(x.x - 0.5) > 1e-9 || r < 1e-9) continue;
    const Vec3d y = x + found.displacement[i];
    turned += (x.y * y.y + x.z * y.z) /
              (r * std::hypot(y.y, y.z));  // cosine of the rotation, -1 after 1.5 turns
    ++count;
  }
  return std::abs(turned / count + 1);
}

/// A bar hits a wall with a tenth of its wave speed and sticks: its momentum vanishes after L / c,
/// when the wave returns from its free end.
double impact(const Machine& machine) {
  Discretisation d = best;
  d.across = 4;
  Scene scene = clamped(bar(d, 1, 0.2, 0));
  scene.bodies[0].material.law = Corotated<double>::name;
  const double c = std::sqrt(E / rho);
  scene.bodies[0].velocity = {-0.1 * c, 0, 0};
  Trial trial(scene, machine);
  const double dt = trial.step_at(0.5);
  Drift drift;
  double before = 0, before_time = 0, turned = 0;
  trial.run(trial.at_rest(dt), 400, static_cast<std::int64_t>(2 / c / dt),
            [&](const State&, const Diagnostics& now) {
              drift.look(trial.first(), now);
              const double p = now.momentum.x;
              if (turned == 0 && before < 0 && p >= 0) {
                turned = before_time + (now.time - before_time) * before / (before - p);
              }
              before = p, before_time = now.time;
            });
  return std::max(std::abs(turned * c - 1), drift.share());
}

// --- steps ---------------------------------------------------------------------------------------

double ringing(double safety, std::int64_t steps, const Machine& machine) {
  Scene scene = bar({.filling = Filling::nodes, .hourglass = 0.1, .across = 3}, 0.4, 0.1);
  scene.time.end = 1;
  Trial trial(scene, machine);
  const double dt = trial.step_at(safety);
  // A run plans its steps likewise.
  scene.time.step = dt;
  plan_steps(scene, trial.model(), trial.backend(), false);
  State state = trial.at_rest(dt);
  for (Index i = 0; i < trial.model().size(); ++i) {
    state.velocity[i].x = 1e-2 * (trial.model().position[i].x - 0.2);
  }
  Drift drift;
  trial.run(state, 200, steps,
            [&](const State&, const Diagnostics& now) { drift.look(trial.first(), now); });
  return drift.share();
}
double short_step(const Machine& m) { return ringing(0.99, 20'000, m); }
double long_step(const Machine& m) { return ringing(1.01, 20'000, m); }
double hundred_thousand_steps(const Machine& m) { return ringing(0.5, 100'000, m); }
double ten_million_steps(const Machine& m) { return ringing(0.5, 10'000'000, m); }

// --- sizes and places ----------------------------------------------------------------------------

/// Displacements of the clamped bar while it sags, relative to its length.
std::vector<Vec3d> sagging(double size, Vec3d where, const Machine& machine) {
  Scene scene = clamped(bar({.filling = Filling::nodes, .hourglass = 0.1, .across = 4}, 1, 0.2));
  scene.bodies[0].scale = size;
  scene.bodies[0].translation = where;
  scene.gravity = {0, 0, -1 / size};
  Trial trial(scene, machine);
  // The step is proportional to the length, so that the number of steps is the same.
  const double dt = 4e-4 * size;
  std::vector<Vec3d> moved;
  trial.run(trial.at_rest(dt), 1, 500,
            [&](const State& state, const Diagnostics&) { moved = state.displacement; });
  for (Vec3d& u : moved) u = u / size;
  return moved;
}
double unlike(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    worst = std::max(worst, norm(a[i] - b[i]));
    largest = std::max(largest, norm(a[i]));
  }
  return largest > 0 && std::isfinite(worst) ? worst / largest : HUGE_VAL;
}
double micrometre(const Machine& m) { return unlike(sagging(1, {}, m), sagging(1e-6, {}, m)); }
double kilometre(const Machine& m) { return unlike(sagging(1, {}, m), sagging(1e3, {}, m)); }
double far_away(const Machine& m) {
  return unlike(sagging(1, {}, m), sagging(1, {1e6, -1e6, 1e6}, m));
}

}  // namespace

std::vector<HardCase> hard_cases() {
  return {
      {"ν = -0.5",
       "The clamped bar under its weight, 1,519 phyxels: error of its deflection against finite "
       "elements.",
       0.03, true, false, sag_auxetic},
      {"ν = 0", "The same.", 0.03, true, false, sag_0},
      {"ν = 0.49", "The same.", 0.03, true, false, sag_049},
      {"ν = 0.499", "The same.", 0.03, true, false, sag_0499},
      {"ν = 0.4999", "The same.", 0.03, true, false, sag_04999},
      {"sheet",
       "A sheet one phyxel thick swings from an edge for a second: drift of energy. It has only "
       "in-plane stiffness, and a warning says so.",
       0.02, false, false, sheet},
      {"thread",
       "A thread of phyxels swings from an end for a second: drift of energy. It has only axial "
       "stiffness, and a warning says so.",
       0.02, false, false, thread},
      {"single phyxel", "A body of one phyxel, which cannot deform: refused.", 0, false, false,
       single_phyxel},
      {"lone phyxel",
       "A phyxel out of reach of all others of its body falls freely: error of its "
       "fall.",
       1e-3, false, false, lone_phyxel},
      {"coincident phyxels",
       "A spinning block with two phyxels at the same point, two 10⁻¹² m apart and two 10⁻⁶ m "
       "apart: drift of energy.",
       0.02, false, false, coincident},
      {"graded cloud",
       "A cube with a spacing ten times smaller in its middle than at its faces, uniformly "
       "strained, then released: error of the gradients, drift of energy.",
       0.02, false, false, graded},
      {"E contrast 10⁶",
       "A bar whose second half is a million times stiffer is stretched: error of the displacement "
       "of its middle.",
       0.02, true, false, contrast},
      {"flattened (Hooke)",
       "A block compressed to a tenth of its length and released: this law softens in compression, "
       "so the case is refused.",
       0, false, false, flattened_hooke},
      {"flattened (neo-Hookean)",
       "The same with a quarter of the step: energy that remains at rest.", 1e-3, false, false,
       flattened_neo},
      {"flattened (corotated)", "The same with the usual step.", 1e-3, false, false,
       flattened_corotated},
      {"inside out (neo-Hookean)",
       "A block released from its mirror image: energy that remains at rest.", 1e-3, false, false,
       inside_out_neo},
      {"inside out (corotated)", "The same.", 1e-3, false, false, inside_out_corotated},
      {"three turns",
       "A neo-Hookean column, stretched by a fifth, has one end rotated by three turns: its middle "
       "should rotate by half of that.",
       1e-3, true, false, twist},
      {"impact",
       "A bar strikes a wall at a tenth of its wave speed and sticks: time at which its momentum "
       "vanishes, drift of energy.",
       0.03, false, false, impact},
      {"step 0.99",
       "A free bar vibrates for 20,000 steps of 0.99 of the stability limit: drift of "
       "energy.",
       0.3, false, false, short_step},
      {"step 1.01", "Steps above the stability limit: refused.", 0, false, false, long_step},
      {"10⁵ steps", "A free bar vibrates with steps of half the limit: drift of energy.", 0.05,
       false, false, hundred_thousand_steps},
      {"10⁷ steps", "The same.", 0.05, false, true, ten_million_steps},
      {"a micrometre",
       "The clamped bar, a micrometre long, compared with the bar of a metre: displacements over "
       "the length.",
       1e-3, false, false, micrometre},
      {"a kilometre", "The same, a kilometre long.", 1e-3, false, false, kilometre},
      {"far away",
       "The bar 1,700 km from the origin, compared with the bar at the origin: "
       "displacements.",
       1e-3, false, false, far_away},
  };
}

HardOutcome outcome_of(const HardCase& hard, const Machine& machine) {
  HardOutcome outcome;
  const auto start = Clock::now();
  try {
    outcome.error = hard.error(machine);
    outcome.good = hard.tolerance > 0 && outcome.error <= hard.tolerance;
  } catch (const DeviceError&) {
    throw;
  } catch (const Error& error) {
    outcome.refused = true;
    outcome.message = error.what();
    outcome.good = hard.tolerance == 0;
  }
  outcome.seconds = seconds_since(start);
  return outcome;
}

}  // namespace phyxel::app
