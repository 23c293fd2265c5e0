#include "phyxel/contacts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/contact.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "rank_sums.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/present_forces.hpp"
#include "solver/step_contacts.hpp"

namespace phyxel {
namespace {

/// The sums of each obstacle over the step from an instant, on this rank, as `StepContacts` would
/// add them.
StepSums sums_of_next_step(const Model& model, const SupportInstant& now, const State& state) {
  StepContacts contacts(model, 1);
  contacts.begin_step(now.time, now.dt, [&](Index i) { return now.velocity[i]; });
  const std::vector<Vec3d> free = free_axes(model);
  State next{.displacement = state.displacement, .velocity = state.velocity};
  for (const Index i : model.contact.phyxels) {
    const DampedFlow flow = damped_flow(part_of(model, i).material.damping, now.dt);
    Vec3d& v = next.velocity[i];
    v = flow.keep * v + (flow.gain / model.mass[i]) * now.other_force[i];
    if (!free.empty()) v = by_components(free[i], v);
    next.displacement[i] += now.dt * v;
  }
  std::vector<Vec3d> prescribed = next.displacement;
  prescribe_displacements(model, now.time + now.dt, prescribed);
  if (!free.empty()) {
    for (const Index i : model.contact.phyxels) {
      const Vec3d way = prescribed[i] - state.displacement[i];
      next.velocity[i] += (1 / now.dt) * (way - by_components(free[i], way));
      next.displacement[i] = prescribed[i];
    }
  }
  contacts.keep_out([](Index) { return true; },
                    [&](Index i) {
                      return Touched{next.displacement[i], next.velocity[i]};
                    },
                    [&](Index i, const Touched& to) {
                      next.displacement[i] = to.displacement;
                      next.velocity[i] = to.velocity;
                    });
  return contacts.sums();
}

Vec3d vector_of(std::span<const ExactSum> sums) {
  return {sums[0].value(), sums[1].value(), sums[2].value()};
}

/// What obstacles do over a time, as sums of each (`ContactTerms`) on this rank.
struct ContactRates {
  StepSums sums;
  double span = 1;  ///< [s]
};

/// What obstacles do at the present state of a solver: in the next step of Verlet's method, or by
/// the penalties of implicit steps and searches for equilibrium.
/// @param state receives the present displacements and velocities
ContactRates rates_now(const Model& model, Backend& backend, const Solver& solver, State& state) {
  if (solver.method() == Method::verlet) {
    const PresentForces present(model, backend, solver);
    const SupportInstant now = present.instant();
    state = present.state();
    return {sums_of_next_step(model, now, state), now.dt};
  }
  backend.download(state);
  const std::span<const ExactSum> known = solver.end_contact();
  if (!known.empty()) return {StepSums(known.begin(), known.end())};
  const ContactPenalty penalty(model);
  const PlacedObstacles at = solver.method() == Method::equilibrium
                                 ? obstacles_after(model, solver.steps() > 0 ? 1 : 0)
                                 : obstacles_over(model, solver.time(), solver.dt());
  ContactRates rates{StepSums(ContactTerms::count * model.obstacles.size())};
  penalty.add_to(at, state.displacement, rates.span, rates.sums);
  return rates;
}

/// Depth of the deepest phyxel of a contact layer in an obstacle [m], 0 if none is inside. Of a
/// share: collective.
double depth_in(const Model& model, std::size_t o, const Solver& solver, const State& state) {
  const Obstacle& obstacle = model.obstacles[o];
  const ObstacleStep here = solver.method() == Method::equilibrium
                                ? obstacles_after(model, solver.steps() > 0 ? 1 : 0)[o]
                                : obstacle.step_from(solver.time(), 0);
  double deepest = 0;
  for_each_gap(
      model, obstacle, here, [&](Index i) { return state.displacement[i]; },
      [&](std::size_t, Vec3d, const Gap& gap) { deepest = std::max(deepest, -gap.distance); });
  return model.share ? model.share->communicator->largest(deepest) : deepest;
}

/// The smallest support of the phyxels that touch obstacles [m]. Of a share: collective.
double smallest_support(const Model& model) {
  double smallest = HUGE_VAL;
  for (const Index i : model.contact.phyxels) {
    smallest = std::min(smallest, model.neighbourhood.support[i]);
  }
  return model.share ? model.share->communicator->smallest(smallest) : smallest;
}

/// Ends a run, on all ranks alike.
[[noreturn]] void say_wrong(const Model& model, const std::string& why) {
  if (model.share) throw AgreedError(ExitCode::diverged, why);
  throw DivergedError(why);
}

/// Refuses readings of phyxels that an obstacle has left inside another one, or that it cannot
/// hold.
void check_depths(const Model& model, const std::vector<ContactReading>& readings) {
  constexpr double deepest = 0.25;
  const double support = smallest_support(model);
  for (const ContactReading& reading : readings) {
    if (!(reading.depth > deepest * support)) continue;
    say_wrong(model,
              fmt::format("phyxels are {:.3g} m deep in obstacle \"{}\", a quarter of a support of "
                          "{:.3g} m is allowed: another obstacle presses them into it, or they are "
                          "too fast for the step",
                          reading.depth, reading.obstacle, support));
  }
}

}  // namespace

void check_contact_speeds(const Model& model, const Solver& solver, double largest_speed) {
  if (model.obstacles.empty() || solver.method() == Method::equilibrium) return;
  const double dt = solver.dt(), support = smallest_support(model);
  for (const Obstacle& obstacle : model.obstacles) {
    const double of_obstacle = obstacle.largest_speed(obstacle.step_from(solver.time(), dt));
    const double speed = largest_speed + of_obstacle;
    const double most = 0.5 * std::min(obstacle.inner_radius(), support);
    if (!(speed * dt > most)) continue;
    say_wrong(
        model,
        fmt::format("phyxels move at up to {:.3g} m/s and obstacle \"{}\" at {:.3g} m/s, {:.3g} "
                    "m against each other in a step of {:.3g} s: they might pass through each "
                    "other unseen; allowed: {:.3g} m, half of {}, by a step of at most {:.3g} s "
                    "(time.step, time.safety), lower speeds, or a thicker obstacle",
                    largest_speed, obstacle.name, of_obstacle, speed * dt, dt, most,
                    obstacle.inner_radius() < support ? "the obstacle's inner radius"
                                                      : "a support of the phyxels",
                    most / speed));
  }
}

const char* shape_name(const Obstacle& obstacle) {
  return ObstacleShapes::with(
      obstacle.form, [](const auto& shape) { return std::decay_t<decltype(shape)>::name; });
}

std::vector<ContactReading> find_contacts(const Model& model, Backend& backend,
                                          const Solver& solver) {
  check_fits(model, backend);
  if (model.obstacles.empty()) return {};
  State state;
  ContactRates rates = rates_now(model, backend, solver, state);
  add_over_ranks(model, rates.sums);
  StepSums all = no_step_sums(model);
  add_words(all, solver.step_sums());
  std::vector<ContactReading> readings;
  for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
    constexpr std::size_t count = ContactTerms::count;
    const std::span<const ExactSum> step = std::span(rates.sums).subspan(o * count, count);
    const std::span<const ExactSum> sums =
        std::span(all).subspan(sums_of_motions(model) + o * count, count);
    const Obstacle& obstacle = model.obstacles[o];
    readings.push_back({.obstacle = obstacle.name,
                        .shape = shape_name(obstacle),
                        .force = vector_of(step.subspan(ContactTerms::impulse, 3)) / rates.span,
                        .torque = vector_of(step.subspan(ContactTerms::moment, 3)) / rates.span,
                        .impulse = vector_of(sums.subspan(ContactTerms::impulse, 3)),
                        .angular_impulse = vector_of(sums.subspan(ContactTerms::moment, 3)),
                        .work = sums[ContactTerms::work].value(),
                        .friction_heat = sums[ContactTerms::friction_heat].value(),
                        .impact_loss = sums[ContactTerms::impact_loss].value(),
                        .depth = depth_in(model, o, solver, state),
                        .place = obstacle.place});
  }
  check_depths(model, readings);
  return readings;
}

std::span<const ContactColumn> contact_columns() {
  using R = const ContactReading&;
  static const ContactColumn columns[] = {
      {"force_x", "N", [](R r) { return r.force.x; }},
      {"force_y", "N", [](R r) { return r.force.y; }},
      {"force_z", "N", [](R r) { return r.force.z; }},
      {"torque_x", "N m", [](R r) { return r.torque.x; }},
      {"torque_y", "N m", [](R r) { return r.torque.y; }},
      {"torque_z", "N m", [](R r) { return r.torque.z; }},
      {"impulse_x", "N s", [](R r) { return r.impulse.x; }},
      {"impulse_y", "N s", [](R r) { return r.impulse.y; }},
      {"impulse_z", "N s", [](R r) { return r.impulse.z; }},
      {"angular_impulse_x", "N m s", [](R r) { return r.angular_impulse.x; }},
      {"angular_impulse_y", "N m s", [](R r) { return r.angular_impulse.y; }},
      {"angular_impulse_z", "N m s", [](R r) { return r.angular_impulse.z; }},
      {"work", "J", [](R r) { return r.work; }},
      {"friction_heat", "J", [](R r) { return r.friction_heat; }},
      {"impact_loss", "J", [](R r) { return r.impact_loss; }},
      {"depth", "m", [](R r) { return r.depth; }},
      {"place_x", "m", [](R r) { return r.place.x; }},
      {"place_y", "m", [](R r) { return r.place.y; }},
      {"place_z", "m", [](R r) { return r.place.z; }},
  };
  return columns;
}

}  // namespace phyxel
