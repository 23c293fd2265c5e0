#include "phyxel/equilibrium.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "phyxel/error.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/newton.hpp"
#include "solver/rigid_support.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {
namespace {

constexpr double on_the_way = 1e-2;     // residual at which the next stage begins
constexpr double share_of_depth = 0.1;  // of `SlipMeasure`

/// Returns a balance with gravity and loads at full size, and with targets unset.
Balance whole_balance(const Model& model, const Newton& newton) {
  const OwnedVectors& vectors = newton.vectors();
  Balance balance;
  balance.target = vectors.make();
  balance.free = free_axes(model);
  balance.free.resize(balance.target.size(), {1, 1, 1});
  const auto is_endless = [](const Motion& motion) {
    return motion.velocity != Vec3d{} || motion.amplitude != Vec3d{};
  };
  for (const Motion& motion : model.motions) {
    if (!is_endless(motion)) continue;
    throw InputError(
        "a motion with a velocity or an amplitude never ends: allowed in a search for "
        "equilibrium are fixed phyxels and motions by a displacement");
  }
  for (const Obstacle& obstacle : model.obstacles) {
    if (!is_endless(obstacle.motion)) continue;
    const std::string why = fmt::format(
        "obstacle.motion of obstacle \"{}\" has a velocity or an amplitude, and never ends: "
        "allowed "
        "in a search for equilibrium are obstacles at rest and motions by a displacement",
        obstacle.name);
    if (model.share) throw AgreedError(ExitCode::bad_input, why);
    throw InputError(why);
  }
  newton.set_applied(full_loads, balance);
  return balance;
}

/// Sets the targets to the positions after a fraction `share` of each motion.
void set_targets(const Model& model, double share, Balance& balance) {
  for (const Motion& motion : model.motions) {
    const Path path = motion.path_after(share);
    for (const Index i : motion.phyxels) {
      balance.target[i] = motion.along_axes(path.at(model.position[i]), balance.target[i]);
    }
  }
}

/// Number of stages of a search: a rotation is followed by an eighth of a turn at a time, since
/// straight paths to the target would flatten the body, and an obstacle by half a support, since it
/// would pass the surface that it is to push.
int stages_of(const Model& model, const OwnedVectors& vectors) {
  double angle = 0, way = 0;
  for (const Motion& motion : model.motions) angle = std::max(angle, norm(motion.rotation));
  for (const Obstacle& o : model.obstacles) {
    angle = std::max(angle, norm(o.motion.rotation));
    way = std::max(way, norm(o.motion.displacement));
  }
  constexpr double share_of_support = 0.5;
  constexpr double most = 10'000;
  const double by_turns = std::ceil(angle / (std::numbers::pi / 4) - 1e-9);
  const double by_way =
      way > 0 ? std::ceil(way / (share_of_support * vectors.smallest_support()) - 1e-9) : 0;
  return static_cast<int>(std::clamp(std::max(by_turns, by_way), 1.0, most));
}

/// True if the bodies of a model may touch something that holds them.
bool touches(const Model& model) { return touching_count(model) > 0; }

/// Refuses a state in which an obstacle or a body is deeper in a body than pressures push it.
void check_depth(const Model& model, const Newton& newton, const Balance& balance,
                 const Newton::Vector& u) {
  constexpr double deepest = 0.25;
  const double depth = newton.contact().largest_depth(balance.obstacles, u);
  if (!(depth > deepest)) return;
  const std::string why = fmt::format(
      "no equilibrium was found: phyxels are up to {:.2g} supports deep in {}, {:.2g} is "
      "allowed; what presses them is stronger than the body",
      depth,
      model.obstacles.empty()     ? "other bodies"
      : model.body_contact.acts() ? "an obstacle or other bodies"
                                  : "an obstacle",
      deepest);
  if (model.share) throw AgreedError(ExitCode::diverged, why);
  throw DivergedError(why);
}

/// Sum of squared distances of prescribed phyxels from the straight paths between the targets of
/// two stages, and of squared lengths of those paths [m²].
struct Distance {
  double off = 0, way = 0;
};
Distance distance_from_way(const OwnedVectors& vectors, const Balance& balance,
                           const Newton::Vector& before, const Newton::Vector& u) {
  const auto moved = [&](Index i, Vec3d v) { return v - by_components(balance.free[i], v); };
  const double way = vectors.sum([&](Index i) {
    const Vec3d step = moved(i, balance.target[i] - before[i]);
    return dot(step, step);
  });
  const double along = vectors.sum([&](Index i) {
    return dot(moved(i, u[i] - before[i]), moved(i, balance.target[i] - before[i]));
  });
  const double share = way > 0 ? std::clamp(along / way, 0.0, 1.0) : 0;
  const double off = vectors.sum([&](Index i) {
    const Vec3d rest = moved(i, u[i] - before[i] - share * (balance.target[i] - before[i]));
    return dot(rest, rest);
  });
  return {off, way};
}

/// Returns the stage of an interrupted search: the first one on whose paths the prescribed phyxels
/// are.
int stage_of(const Model& model, const OwnedVectors& vectors, Balance balance, int stages,
             const Newton::Vector& u) {
  for (int stage = 1; stage < stages; ++stage) {
    const Newton::Vector before = balance.target;
    set_targets(model, static_cast<double>(stage) / stages, balance);
    const Distance d = distance_from_way(vectors, balance, before, u);
    if (d.off <= 1e-20 * d.way) return stage;  // rounding
  }
  return stages;
}

[[noreturn]] void say_not_found(const Model& model, const Newton& newton, const Equilibrium& found,
                                const NewtonReport& report, double tolerance) {
  const std::string why = fmt::format(
      "no equilibrium was found in {} steps of Newton's method and {} evaluations of the forces "
      "({}): the residual force is {:.2g} of what is applied, {:.2g} is needed; nothing may hold a "
      "part of the body{}{}, or it buckles: allowed are more support, smaller loads, or a run in "
      "time "
      "with damping",
      found.steps, found.evaluations, report.why, report.residual, tolerance,
      touches(model) ? ", or it does not touch yet what is to hold it" : "",
      newton.contact().rubs() ? ", or it slides: friction holds no more than its coefficient times "
                                "what presses"
                              : "");
  if (model.share) throw AgreedError(ExitCode::diverged, why);
  throw DivergedError(why);
}

}  // namespace

Equilibrium find_equilibrium(const Model& model, Backend& backend,
                             const EquilibriumOptions& options) {
  check_fits(model, backend);
  check_precision(backend, Method::equilibrium);
  Newton newton(model, backend, options.most_steps);
  newton.observe(options.observer);
  const OwnedVectors& vectors = newton.vectors();
  Balance balance = whole_balance(model, newton);
  if (!touches(model)) refuse_unsupported_bodies(model, balance);  // else something may hold them
  Equilibrium found;
  backend.set_history_interval(endless_time);
  backend.download(found.state);
  found.state.displacement = options.start ? *options.start : vectors.make();
  found.state.velocity = vectors.make();
  check_state(found.state, model.size());  // of the caller's start
  NewtonReport report;
  const int stages = stages_of(model, vectors);
  const int first =
      options.start ? stage_of(model, vectors, balance, stages, found.state.displacement) : 1;
  for (int stage = first; stage <= stages; ++stage) {
    set_targets(model, static_cast<double>(stage) / stages, balance);
    balance.obstacles = obstacles_after(model, static_cast<double>(stage) / stages,
                                        static_cast<double>(stage - 1) / stages);
    balance.slip.rests = true;
    if (newton.contact().rubs()) {
      // A search that goes on in its first stage counts slips from rest, as it has begun.
      balance.slip = {.from = stage == 1 ? vectors.make() : found.state.displacement,
                      .share = share_of_depth,
                      .rests = true};
    }
    const bool last = stage == stages;
    const double tolerance = last ? options.tolerance : std::max(options.tolerance, on_the_way);
    report = newton.solve(balance, tolerance, found.state.displacement);
    found.steps += report.steps;
    found.evaluations += report.evaluations;
    if (report.found) {
      if (touches(model)) check_depth(model, newton, balance, found.state.displacement);
      continue;
    }
    vectors.refresh_ghosts(found.state.displacement);
    backend.put(found.state);
    if (report.interrupted) {
      throw InterruptedError(
          fmt::format("the search for rest was stopped after {} steps of Newton's method, at a "
                      "residual force of {:.2g} of what is applied, {:.2g} is needed",
                      found.steps, report.residual, options.tolerance));
    }
    say_not_found(model, newton, found, report, tolerance);
  }
  if (newton.contact().rubs()) {
    StepSums rates(ContactTerms::count * touching_count(model));
    newton.contact().add_to(balance.obstacles, found.state.displacement, found.state.velocity, 1,
                            rates);
    found.contact = words_of(std::move(rates));
    found.contact_force = vectors.make();
    newton.contact().add(balance.obstacles, found.state.displacement, found.contact_force);
  }
  found.residual = report.residual;
  vectors.refresh_ghosts(found.state.displacement);
  backend.put(found.state);
  backend.commit_history();
  State committed;
  backend.download(committed);
  found.state.history = std::move(committed.history);
  return found;
}

}  // namespace phyxel
