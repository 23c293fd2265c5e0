#include "solver/rigid_bodies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "phyxel/contacts.hpp"
#include "phyxel/error.hpp"
#include "rank_sums.hpp"

namespace phyxel {
namespace {

constexpr int terms = 6;  // of each body: impulse and angular impulse
static_assert(ContactTerms::impulse == 0 && ContactTerms::moment == 3);

/// The state with the velocities at its time: between those of the last step and the next one.
/// @param fall change of velocity by gravity until then [m/s]
RigidState at_its_time(const RigidMass& mass, const RigidState& state, Vec3d fall) {
  RigidState now = state;
  now.velocity += fall + (0.5 / mass.mass) * state.impulse;
  now.angular_momentum += 0.5 * state.angular_impulse;
  return now;
}

}  // namespace

RigidBodies::RigidBodies(const Model& model)
    : model_(model), bodies_(free_bodies(model)), contacts_(model) {
  number_.resize(model.obstacles.size());
  for (std::size_t k = 0; k < bodies_.size(); ++k) number_[bodies_[k]] = k;
  steps_.resize(bodies_.size());
  earlier_.resize(terms * bodies_.size());
  if (!empty()) of_held_points_.resize(ContactTerms::count * model.obstacles.size());
  put({}, 0);
}

void RigidBodies::put(std::span<const RigidState> states, double dt) {
  if (!states.empty() && states.size() != bodies_.size()) {
    throw InputError(fmt::format(
        "a state of {} free rigid bodies for a model of {}: allowed is one of each, or none",
        states.size(), bodies_.size()));
  }
  states_.assign(states.begin(), states.end());
  if (!states.empty()) return;
  for (const std::size_t o : bodies_) {
    states_.push_back(model_.obstacles[o].start);
    states_.back().velocity += (-dt / 2) * model_.gravity;
  }
}

void RigidBodies::begin_step(double time, double dt) {
  if (empty()) return;
  const std::vector<RigidState> start = states_;
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    RigidState& state = states_[k];
    const double mass = model_.obstacles[bodies_[k]].free->mass;
    state.velocity += dt * model_.gravity + (1 / mass) * std::exchange(state.impulse, {});
    state.angular_momentum += std::exchange(state.angular_impulse, {});
  }
  contacts_.resolve(time, dt, start, states_);
  if (!model_.share || model_.share->communicator->rank() == 0) {  // all ranks have found the same
    for (const HeldImpulse& on : contacts_.on_held()) {
      for (int t = 0; t < ContactTerms::count; ++t) {
        of_held_points_[on.obstacle * ContactTerms::count + t].add(on.terms.value[t]);
      }
    }
  }
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    const Obstacle& obstacle = model_.obstacles[bodies_[k]];
    states_[k] = drifted(*obstacle.free, states_[k], dt);
    steps_[k] = obstacle.step_between(start[k], states_[k], dt);
  }
}

StepSums RigidBodies::with_held_points(StepSums sums) const {
  for (std::size_t s = 0; s < of_held_points_.size(); ++s) sums[s].add(of_held_points_[s]);
  return sums;
}

void RigidBodies::act_back(std::span<const ExactSum> sums) {
  if (empty()) return;
  StepSums of_step;
  for (const std::size_t o : bodies_) {
    for (int t = 0; t < terms; ++t) {
      const std::size_t k = of_step.size();
      ExactSum change = sums[o * ContactTerms::count + t];
      ExactSum now = change;
      const std::span<std::int64_t> to = change.ready(), from = earlier_[k].ready();
      for (std::size_t w = 0; w < to.size(); ++w) to[w] -= from[w];
      earlier_[k] = now;
      of_step.push_back(change);
    }
  }
  add_over_ranks(model_, of_step);
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    const Obstacle& obstacle = model_.obstacles[bodies_[k]];
    const auto vector = [&](int first) {
      const ExactSum* at = &of_step[terms * k + first];
      return Vec3d{at[0].value(), at[1].value(), at[2].value()};
    };
    const Vec3d impulse = vector(ContactTerms::impulse), moment = vector(ContactTerms::moment);
    RigidState& state = states_[k];
    state.impulse += -impulse;
    // Sums are about the place at rest; the impulses act where the phyxels were as the step began.
    state.angular_impulse += cross(state.place - obstacle.place, impulse) - moment;
  }
}

void add_rigid(const Model& model, std::span<const RigidState> states, double lag,
               Diagnostics& sums) {
  const std::vector<std::size_t> bodies = free_bodies(model);
  for (std::size_t k = 0; k < states.size(); ++k) {
    const RigidMass& mass = *model.obstacles[bodies[k]].free;
    const RigidState& state = states[k];
    sums.kinetic_energy += kinetic_energy(mass, at_its_time(mass, state, lag * model.gravity));
    sums.gravity_energy += -mass.mass * dot(model.gravity, state.place - mass.centre);
    // Phyxels have all of the impulses already that act back.
    const Vec3d momentum = mass.mass * (state.velocity + lag * model.gravity) + state.impulse;
    sums.momentum += momentum;
    sums.angular_momentum +=
        cross(state.place, momentum) + state.angular_momentum + state.angular_impulse;
    sums.contact_loss += state.loss;
  }
}

std::vector<RigidReading> read_rigid_bodies(const Model& model, const Backend& backend,
                                            const Solver& solver) {
  std::vector<RigidReading> readings;
  const std::vector<RigidState> states = backend.rigid_states();
  if (states.empty()) return readings;
  RigidBodies next(model);  // after the coming step
  next.put(states, solver.dt());
  next.begin_step(solver.time(), solver.dt());
  for (const std::size_t o : free_bodies(model)) {
    const Obstacle& obstacle = model.obstacles[o];
    const RigidState& after = next.states()[readings.size()];
    RigidState now = states.at(readings.size());
    now.velocity = 0.5 * (now.velocity + after.velocity);
    now.angular_momentum = 0.5 * (now.angular_momentum + after.angular_momentum);
    readings.push_back({.obstacle = obstacle.name,
                        .shape = shape_name(obstacle),
                        .place = now.place,
                        .rotation = axis_angle(now.turn),
                        .velocity = now.velocity,
                        .spin = angular_velocity(obstacle.free->inertia, now),
                        .kinetic_energy = kinetic_energy(*obstacle.free, now)});
  }
  return readings;
}

std::span<const RigidColumn> rigid_columns() {
  using R = const RigidReading&;
  static const RigidColumn columns[] = {
      {"place_x", "m", [](R r) { return r.place.x; }},
      {"place_y", "m", [](R r) { return r.place.y; }},
      {"place_z", "m", [](R r) { return r.place.z; }},
      {"rotation_x", "rad", [](R r) { return r.rotation.x; }},
      {"rotation_y", "rad", [](R r) { return r.rotation.y; }},
      {"rotation_z", "rad", [](R r) { return r.rotation.z; }},
      {"velocity_x", "m/s", [](R r) { return r.velocity.x; }},
      {"velocity_y", "m/s", [](R r) { return r.velocity.y; }},
      {"velocity_z", "m/s", [](R r) { return r.velocity.z; }},
      {"spin_x", "rad/s", [](R r) { return r.spin.x; }},
      {"spin_y", "rad/s", [](R r) { return r.spin.y; }},
      {"spin_z", "rad/s", [](R r) { return r.spin.z; }},
      {"kinetic_energy", "J", [](R r) { return r.kinetic_energy; }},
  };
  return columns;
}

}  // namespace phyxel
