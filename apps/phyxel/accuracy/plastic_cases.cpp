/// Bodies of metal in states that are the same everywhere: cycles of tension and compression,
/// shear.
#include <algorithm>
#include <cmath>
#include <utility>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/solver.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

constexpr double yield_stress = 0.01 * E, hardening = 0.05 * E;  // [Pa]

Scene metal(const Discretisation& d, double growth) {
  Scene scene = bar(d, 1, 1);
  Material& material = scene.bodies[0].material;
  material.law = J2<double>::name;
  material.parameters = {{"yield_stress", yield_stress}, {"hardening", growth}};
  return scene;
}

/// J2 plasticity with linear hardening in one dimension: the closed form of uniaxial stress.
struct Rod {
  double plastic_strain = 0, equivalent = 0;

  /// Kirchhoff stress [Pa] after a monotonic change of the logarithmic strain.
  double stress_at(double strain) {
    const double trial = E * (strain - plastic_strain);
    const double excess = std::abs(trial) - yield_stress - hardening * equivalent;
    if (excess > 0) {
      const double flow = excess / (E + hardening);
      equivalent += flow;
      plastic_strain += std::copysign(flow, trial);
    }
    return E * (strain - plastic_strain);
  }
};

/// A cube on rollers, drawn and pressed by turns, free to the sides.
Solution cycles(const Discretisation& d) {
  const auto begin = Clock::now();
  const Scene scene = metal(d, hardening);
  const Cloud cloud = cloud_of(scene, d);
  Model model = build_model(scene, std::span(&cloud, 1));
  const auto hold = [&](const char* region, Axes axes) {
    model.motions.push_back({.phyxels = cloud.regions.at(region), .duration = 1, .axes = axes});
  };
  hold("y-", {.x = false, .y = true, .z = false});
  hold("z-", {.x = false, .y = false, .z = true});
  hold("x-", {.x = true, .y = false, .z = false});
  hold("x+", {.x = true, .y = false, .z = false});
  const auto placed = [&](const char* region) {
    return mean_of(model, cloud.regions.at(region), model.position).x;
  };
  const double length = placed("x+") - placed("x-"), volume = model.parts[0].volume;
  const auto backend = make_cpu_backend(model, Precision::double_);
  Solution solution{.phyxels = model.size(),
                    .neighbours = static_cast<double>(model.pairs()) / model.size(),
                    .setup_seconds = seconds_since(begin)};
  const auto start = Clock::now();
  Rod rod;
  State state;
  double worst = 0;
  // Beyond yield, back within it, beyond it the other way, and once more.
  for (const double strain : {0.02, 0.005, -0.03, -0.025, 0.06}) {
    const double stretch = std::exp(strain);
    model.motions.back().displacement = {length * (stretch - 1), 0, 0};
    const std::vector<Vec3d> before = state.displacement;
    const Equilibrium found = find_equilibrium(
        model, *backend, {.tolerance = 1e-10, .start = before.empty() ? nullptr : &before});
    state = found.state;
    solution.evaluations += found.evaluations;
    std::vector<Vec3d> force;
    backend->internal_forces(force);
    double reaction = 0;
    for (const Index i : cloud.regions.at("x+")) reaction -= force[i].x;
    const double stress = stretch * reaction * length / volume;  // Kirchhoff's
    worst = std::max(worst, std::abs(stress - rod.stress_at(strain)));
  }
  solution.seconds = seconds_since(start);
  solution.found = {{"largest error of the stress by the yield stress", worst / yield_stress}};
  return solution;
}

// --- shear ---------------------------------------------------------------------------------------

/// A cube whose phyxels all follow a simple shear of 5, in the directions of a turned frame.
class Sheared {
 public:
  static constexpr double duration = 1;  // [s]

  Sheared(const Discretisation& d, const Mat3d& turn) : turn_(turn) {
    const Scene scene = metal(d, 0);
    cloud_ = cloud_of(scene, d);
    Mat3d shear;
    shear(0, 1) = 5;
    for (Vec3d& x : cloud_.position) x = turn * x;
    for (Vec3d& x : cloud_.surface.position) x = turn * x;
    for (Vec3d& n : cloud_.surface.normal) n = turn * n;
    model_ = build_model(scene, std::span(&cloud_, 1));
    for (Index i = 0; i < model_.size(); ++i) {
      const Vec3d there = turn * (shear * (transpose(turn) * model_.position[i]));
      model_.motions.push_back({.phyxels = {i}, .displacement = there, .duration = duration});
    }
    backend_ = make_cpu_backend(model_, Precision::double_);
    State state;
    state.displacement.resize(model_.position.size());
    state.velocity.resize(model_.position.size());
    state.dt = duration / steps;
    solver_.emplace(*backend_, state);
  }

  void step(std::int64_t count) { solver_->step(count); }
  /// Turns the whole body at once, as a step would, and commits its history.
  void turn_by(const Mat3d& more) {
    std::vector<Vec3d> moved = solver_->state().displacement;
    for (Index i = 0; i < model_.size(); ++i) {
      moved[i] = more * (model_.position[i] + moved[i]) - model_.position[i];
    }
    backend_->put_displacements(moved);
    backend_->commit_history();
  }
  /// The largest departure of the von Mises stress from the yield stress, by that.
  double departure() {
    std::vector<double> von_mises;
    stress_fields(model_, *backend_, &von_mises, nullptr);
    double most = 0;
    for (const double q : von_mises) most = std::max(most, std::abs(q / yield_stress - 1));
    return most;
  }
  /// Internal forces [N], turned back into the frame of the shear.
  std::vector<Vec3d> forces() {
    std::vector<Vec3d> force;
    backend_->internal_forces(force);
    for (Vec3d& f : force) f = transpose(turn_) * f;
    return force;
  }
  const Model& model() const { return model_; }

  static constexpr std::int64_t steps = 1000;

 private:
  Mat3d turn_;
  Cloud cloud_;
  Model model_;
  std::unique_ptr<Backend> backend_;
  std::optional<Solver> solver_;
};

Mat3d identity() {
  Mat3d one;
  for (int k = 0; k < 3; ++k) one(k, k) = 1;
  return one;
}
/// A third of a turn about the diagonal.
Mat3d third_of_a_turn() {
  Mat3d turn;
  turn(0, 1) = turn(1, 2) = turn(2, 0) = 1;
  return turn;
}

Solution shearing(const Discretisation& d) {
  const auto begin = Clock::now();
  Sheared body(d, identity()), copy(d, third_of_a_turn());
  Solution solution{.phyxels = body.model().size(),
                    .neighbours = static_cast<double>(body.model().pairs()) / body.model().size(),
                    .evaluations = 2 * Sheared::steps,
                    .setup_seconds = seconds_since(begin)};
  const auto start = Clock::now();
  constexpr int looks = 50;
  double departure = 0, difference = 0;
  for (int k = 1; k <= looks; ++k) {
    body.step(Sheared::steps / looks);
    copy.step(Sheared::steps / looks);
    if (k < looks / 10) continue;  // elastic
    departure = std::max(departure, body.departure());
    const std::vector<Vec3d> force = body.forces(), turned = copy.forces();
    double scale = 0, apart = 0;
    for (std::size_t i = 0; i < force.size(); ++i) {
      scale = std::max(scale, norm(force[i]));
      apart = std::max(apart, norm(turned[i] - force[i]));
    }
    difference = std::max(difference, apart / scale);
  }
  body.turn_by(third_of_a_turn());
  const double after_turn = body.departure();
  solution.seconds = seconds_since(start);
  solution.found = {{"von Mises stress beside the yield stress", departure},
                    {"the same after a turn", after_turn},
                    {"forces of a turned copy", difference}};
  return solution;
}

}  // namespace

std::vector<AccuracyCase> plastic_cases() {
  return {
      {.name = "cycles",
       .what =
           "A cube of J2 metal with linear hardening, on rollers and free to contract sideways, is "
           "alternately stretched and compressed to logarithmic strains of 0.02, 0.005, -0.03, "
           "-0.025 and 0.06. Reference: uniaxial stress in closed form, with the Kirchhoff stress "
           "E (ε - ε_p) and a flow stress that grows by H ε̄.",
       .across = {3, 5},
       .solve = cycles,
       .closures = {0, 1e-11},
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}},
      {.name = "simple-shear",
       .what =
           "A cube of J2 metal without hardening is sheared to γ = 5 in 1,000 steps; the motion of "
           "all phyxels is prescribed. Its von Mises stress should stay the yield stress, also "
           "after a rotation of the body by 120° in one step; the forces of a copy that lies "
           "rotated by 120° should be the same.",
       .across = {4},
       .solve = shearing,
       .closures = {0},
       .jitters = {0, 0.2},
       .hourglass = {0}},
  };
}

}  // namespace phyxel::app
