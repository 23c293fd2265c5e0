/// Halving and doubling of the step of Verlet's method.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "model/owned_vectors.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/solver.hpp"
#include "solver/body_momenta.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/following_loads.hpp"
#include "solver/host_threads.hpp"
#include "solver/present_contact.hpp"
#include "solver/present_forces.hpp"

namespace phyxel {
namespace {

using Vectors = std::vector<Vec3d>;

/// Largest displacement of a phyxel, in supports, in differences of accelerations: large enough
/// that rounding, and small enough that second-order terms, leave them accurate to some percent, in
/// float too.
constexpr double compared_share = 3e-3;

/// Accelerations of a model at states near the present one.
class Accelerations {
 public:
  Accelerations(const Model& model, Backend& backend, double time)
      : model_(model),
        backend_(backend),
        time_(time),
        owned_(model, host_threads(backend)),
        following_(model),
        free_(free_axes(model)) {}

  /// Returns a vector of phyxel i with its prescribed components set to zero.
  Vec3d free(Index i, Vec3d vector) const {
    return free_.empty() ? vector : by_components(free_[i], vector);
  }
  /// Returns the accelerations [m/s²] without damping at the displacements of a state, whose ghosts
  /// are updated. Prescribed components are zero. Collective.
  /// @param use `frozen` for elastic forces alone
  Vectors at(State& state, HistoryUse use) const {
    owned_.refresh_ghosts(state.displacement);
    backend_.put(state);
    Vectors all;
    backend_.internal_forces(all, use);
    const std::span<const Vec3d> external = backend_.external_forces();
    for (std::size_t i = 0; i < external.size(); ++i) all[i] += external[i];
    add_loads(following_, time_, state.displacement, all);
    owned_.for_each(
        [&](Index i) { all[i] = free(i, (1 / model_.mass[i]) * all[i] + model_.gravity); });
    return all;
  }
  /// Returns the derivatives of the elastic accelerations along vectors w of any unit. Collective.
  /// @param here the accelerations at the state
  Vectors derivatives(const State& state, const Vectors& here, const Vectors& w) const {
    Vectors found(here.size());
    const double largest = owned_.largest([&](Index i) { return norm(w[i]); });
    if (!(largest > 0)) return found;
    const double share = compared_share * owned_.smallest_support() / largest;
    State moved = state;
    owned_.for_each([&](Index i) { moved.displacement[i] += share * w[i]; });
    const Vectors there = at(moved, HistoryUse::frozen);
    owned_.for_each([&](Index i) { found[i] = (1 / share) * (there[i] - here[i]); });
    return found;
  }
  /// Returns |to| / |from|, or 0 if `from` is zero. Collective.
  double growth(const Vectors& from, const Vectors& to) const {
    const double length = owned_.product(from, from);
    return length > 0 ? std::sqrt(owned_.product(to, to) / length) : 0;
  }

 private:
  const Model& model_;
  Backend& backend_;
  double time_;
  OwnedVectors owned_;
  FollowingLoads following_;
  Vectors free_;  // 0 along prescribed axes, else 1; empty if none are prescribed
};

}  // namespace

void Looks::halve_step() {
  next *= 2;
  for (std::int64_t* const step : {&last, &measured, &too_long}) {
    if (*step >= 0) *step *= 2;
  }
  measured_share /= 4;
  change /= 2;
}

void Looks::double_step() {
  for (std::int64_t* const step : {&next, &last, &measured, &too_long}) {
    if (*step >= 0) *step /= 2;
  }
  measured_share *= 4;
  change *= 2;
  ++doublings;
}

void Solver::change_step(std::int64_t steps, double dt) {
  if (!model_ || method_ != Method::verlet) {
    throw InputError("only Verlet's steps of a solver that knows its model change their size");
  }
  const Accelerations accelerations(*model_, backend_, time());
  State state = this->state();
  const Vectors before = accelerations.at(state, HistoryUse::trial),
                elastic = accelerations.at(state, HistoryUse::frozen);
  // Penalties push, too, from where phyxels are.
  const auto add_contact = [&](Vectors& acceleration) {
    const PresentContact contact = present_contact(*model_, backend_, state, time(), dt_);
    for (std::size_t i = 0; i < contact.force.size(); ++i) {
      acceleration[i] +=
          accelerations.free(static_cast<Index>(i), (1 / model_->mass[i]) * contact.force[i]);
    }
  };
  Vectors pushed = before;
  add_contact(pushed);
  Vectors v(before.size());  // at t
  const auto for_each = [&](auto&& each) {
    for (const Part& part : model_->parts) {
      for (Index i = part.begin; i < part.owned_end(); ++i) each(i, part.material.damping);
    }
  };
  for_each([&](Index i, double damping) {
    const DampedFlow flow = damped_flow(damping, dt_ / 2);
    v[i] = accelerations.free(i, flow.keep * state.velocity[i] + flow.gain * pushed[i]);
  });
  const Vectors rates = accelerations.derivatives(state, elastic, v);
  const Vectors along_itself = accelerations.derivatives(state, elastic, elastic),
                along_rates = accelerations.derivatives(state, elastic, rates);
  // ω²Δt²/4 of the fastest parts of the motion.
  const double longest = std::max(dt_, dt);
  const double fastest = 0.25 * longest * longest *
                         std::max(accelerations.growth(elastic, along_itself),
                                  accelerations.growth(rates, along_rates));
  const StepChange change = fastest < 1 ? step_change(dt_, dt) : StepChange{};
  const Vectors displacement = state.displacement, velocity = v;
  for_each([&](Index i, double) {
    state.displacement[i] += change.first * elastic[i] + change.displacement * along_itself[i];
    v[i] += change.velocity * along_rates[i] - change.first * rates[i];
  });
  // Derivatives are differences of forces, whose torques vanish where these act alone.
  BodyMomenta(*model_).keep({displacement, velocity}, state.displacement, v);
  Vectors after = accelerations.at(state, HistoryUse::trial);
  add_contact(after);
  for_each([&](Index i, double damping) {
    // Prescribed velocities stay what they are.
    const Vec3d earlier = velocity_before(v[i], after[i], damping, dt / 2);
    state.velocity[i] += accelerations.free(i, earlier - state.velocity[i]);
  });
  for (RigidState& body : state.rigid) body.velocity += ((dt_ - dt) / 2) * model_->gravity;
  first_step_ += steps - steps_;  // the number of steps taken does not change
  state.step = steps_ = steps;
  const double step_before = dt_;
  state.dt = dt_ = dt;
  backend_.put(state);
  change_step_sums(step_before, dt);
}

void Solver::change_step_sums(double before, double after) {
  if (!has_moving_supports(*model_)) return;
  StepSums work = no_step_sums(*model_);
  add_words(work, work_of_changes_);
  const PresentForces present(*model_, backend_, *this);
  for (std::size_t m = 0; m < sums_of_motions(*model_); ++m) {
    const Motion& motion = model_->motions[m];
    if (motion.stands_still()) continue;
    // The next step takes the one before for a step of its own size.
    const Path taken = motion.last_step(time(), before), missed = motion.last_step(time(), after);
    for_each_support_force(*model_, motion, present.instant(), [&](Index i, Vec3d force) {
      const Vec3d x = model_->position[i];
      work[m].add(0.5 * dot(force, taken.at(x) - missed.at(x)));
    });
  }
  work_of_changes_ = words_of(std::move(work));
}

void Solver::halve_step() {
  change_step(2 * steps_, dt_ / 2);
  looks_.halve_step();
}

void Solver::double_step() {
  if (steps_ % 2 != 0) {
    throw InputError(
        fmt::format("step {}: steps can be doubled after an even number of steps only", steps_));
  }
  change_step(steps_ / 2, 2 * dt_);
  looks_.double_step();
}

}  // namespace phyxel
