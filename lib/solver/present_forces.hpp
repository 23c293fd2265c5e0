/// All forces but those of supports at the present state of a solver.
#pragma once

#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/solver.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/following_loads.hpp"
#include "solver/present_contact.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// The state of a solver and the forces on it, from which forces of supports follow.
class PresentForces {
 public:
  /// Downloads the state and evaluates the forces. Collective on a share.
  PresentForces(const Model& model, Backend& backend, const Solver& solver)
      : time_(solver.time()),
        dt_(solver.method() == Method::equilibrium ? 0 : solver.dt()),
        single_(backend.precision() == Precision::single) {
    backend.download(state_);
    const std::span<const Vec3d> known = solver.end_force();
    if (!known.empty()) {
      force_.assign(known.begin(), known.end());
      return;
    }
    backend.internal_forces(force_);
    refresh_for_following(model, state_.displacement);
    add_loads(FollowingLoads(model), time_of_loads(solver), state_.displacement, force_);
    const std::span<const Vec3d> external = backend.external_forces();
    for (std::size_t i = 0; i < external.size(); ++i) force_[i] += external[i];
    for (std::size_t i = 0; i < force_.size(); ++i) force_[i] += model.mass[i] * model.gravity;
    if (solver.method() != Method::verlet) return;
    contact_ = present_contact(model, backend, state_, time_, dt_);
    for (std::size_t i = 0; i < contact_.force.size(); ++i) force_[i] += contact_.force[i];
  }

  /// The present state.
  const State& state() const { return state_; }
  /// What penalties do in Verlet's steps; their forces are among those of the instant.
  const PresentContact& contact() const { return contact_; }
  /// The instant for `for_each_support_force`, which refers to this object.
  SupportInstant instant() const { return {time_, dt_, single_, state_.velocity, force_}; }

 private:
  double time_, dt_;  // [s]; dt 0: at rest
  bool single_;
  State state_;
  PresentContact contact_;
  std::vector<Vec3d> force_;  // [N]
};

}  // namespace phyxel
