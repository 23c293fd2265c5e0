/// Runs of the hard cases.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "accuracy/hard_cases.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/solver.hpp"

namespace phyxel::app {

/// A scene on a machine, stepped with the stability watch of runs.
class Trial {
 public:
  Trial(const Scene& scene, const Machine& machine) : Trial(scene, clouds_of(scene), machine) {}
  Trial(const Scene& scene, std::vector<Cloud> clouds, const Machine& machine)
      : scene_(scene),
        clouds_(std::move(clouds)),
        model_(build_model(scene_, clouds_)),
        backend_(make_backend(model_, machine.precision, machine.device)) {}

  const Model& model() const { return model_; }
  Backend& backend() { return *backend_; }
  const std::vector<Index>& region(const char* name) const { return clouds_[0].regions.at(name); }

  Equilibrium rest() { return find_equilibrium(model_, *backend_); }

  /// A time step [s]. @param safety share of the largest stable step
  double step_at(double safety) { return safety * step_limit(model_, *backend_).largest_step; }
  /// Takes `steps` from a state, and calls look(state, diagnostics) `looks` times at equal
  /// intervals.
  /// @throws DivergedError from the watch
  template <class Look>
  void run(const State& start, int looks, std::int64_t steps, Look&& look) {
    Solver solver(*backend_, start);
    first_ = diagnose(model_, *backend_, solver);
    StabilityWatch watch(model_, first_);
    for (int k = 1; k <= looks; ++k) {
      const std::int64_t until = steps * k / looks;
      solver.step(until - solver.steps());
      const Diagnostics now = diagnose(model_, *backend_, solver);
      watch.check(now);
      look(solver.state(), now);
    }
  }
  State at_rest(double dt) const { return initial_state(model_, scene_, dt); }
  const Diagnostics& first() const { return first_; }  ///< Diagnostics of the first state of `run`.

 private:
  static std::vector<Cloud> clouds_of(const Scene& scene) {
    std::vector<Cloud> clouds;
    for (const BodyRequest& body : scene.bodies) clouds.push_back(make_cloud(body));
    return clouds;
  }
  Scene scene_;
  std::vector<Cloud> clouds_;
  Model model_;
  std::unique_ptr<Backend> backend_;
  Diagnostics first_;
};

/// Largest change of the total energy, relative to the largest kinetic and elastic energy.
class Drift {
 public:
  void look(const Diagnostics& first, const Diagnostics& now) {
    stray_ = std::max(stray_, std::abs(now.total_energy() - first.total_energy()));
    if (!std::isfinite(now.total_energy())) stray_ = HUGE_VAL;
    motion_ =
        std::max({motion_, first.kinetic_and_elastic_energy(), now.kinetic_and_elastic_energy()});
  }
  double share() const { return stray_ / motion_; }

 private:
  double stray_ = 0, motion_ = 0;
};

}  // namespace phyxel::app
