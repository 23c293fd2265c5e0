#include "phyxel/contacts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/contact.hpp"
#include "model/rigid_tips.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/held_overlaps.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "rank_sums.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/contact_stiffness.hpp"
#include "solver/implicit_step.hpp"
#include "solver/next_step.hpp"
#include "solver/present_forces.hpp"
#include "solver/say_diverged.hpp"

namespace phyxel {
namespace {

constexpr const char* body_shape = "body";  // where readings of obstacles have a shape

Vec3d vector_of(std::span<const ExactSum> sums) {
  return {sums[0].value(), sums[1].value(), sums[2].value()};
}

/// What obstacles and bodies do over a time, as sums of each (`ContactTerms`) on this rank.
struct ContactRates {
  StepSums sums;
  double span = 1;             ///< [s]
  std::vector<double> depths;  ///< As of `NextStep`; empty if they are not known.
};

/// What obstacles do at the present state of a solver: in the next step of Verlet's method, or by
/// the penalties of implicit steps and searches for equilibrium.
/// @param state receives the present displacements and velocities; of a model without obstacles
/// they may be missing
ContactRates rates_now(const Model& model, Backend& backend, const Solver& solver, State& state) {
  if (solver.method() == Method::verlet) {
    if (auto next = next_step_of_device(backend, solver.time(), solver.dt())) {
      if (!model.obstacles.empty()) backend.download(state);  // for depths in them
      return {std::move(next->sums), solver.dt(), std::move(next->depths)};
    }
    const PresentForces present(model, backend, solver);
    const SupportInstant now = present.instant();
    state = present.state();
    NextStep next = next_step(model, backend, now, state);
    return {std::move(next.sums), now.dt, std::move(next.depths)};
  }
  backend.download(state);
  const std::span<const ExactSum> known = solver.end_contact();
  ContactRates rates{StepSums(known.begin(), known.end())};
  if (!known.empty() && !model.body_contact.acts()) return rates;
  ContactPenalty penalty(model);
  const bool rests = solver.method() == Method::equilibrium;
  const double stage = penalty.rubs() ? stage_of_step(solver.dt()) : solver.dt();
  const double share = solver.steps() > 0 ? 1 : 0;
  const PlacedObstacles at =
      rests ? obstacles_after(model, share, share) : obstacles_over(model, solver.time(), stage);
  SlipMeasure slip;
  if (penalty.rubs()) {
    // Where the search for rest is not known any more, friction is none.
    slip = slip_of_stage(rests ? 0 : stage, state.displacement, state.velocity);
  }
  penalty.linearise(at, state.displacement, slip, Renewal::all, [&] {
    std::vector<Mat3d> gradient;
    backend.displacement_gradients(gradient);
    return gradient;
  });
  rates.depths = penalty.bodies().depths().of_body;
  if (!known.empty()) return rates;
  rates.sums.resize(ContactTerms::count * touching_count(model));
  penalty.add_to(at, state.displacement, state.velocity, rates.span, rates.sums);
  return rates;
}

/// How deep phyxels are: the largest depth, and the largest share of a support.
struct Depth {
  double depth = 0;  ///< [m]
  double share = 0;

  void keep(double other, double support) {
    depth = std::max(depth, other);
    share = std::max(share, other / support);
  }
};

/// The larger depths of all ranks. Collective.
Depth of_all_ranks(const Model& model, const Depth& own) {
  if (!model.share) return own;
  const Communicator& ranks = *model.share->communicator;
  return {ranks.largest(own.depth), ranks.largest(own.share)};
}

/// Depths of the phyxels of the contact layer in each obstacle, 0 if none is inside. Of a share:
/// collective.
std::vector<Depth> depths_in_obstacles(const Model& model, const Solver& solver,
                                       const State& state) {
  std::vector<Depth> depths(model.obstacles.size());
  if (depths.empty()) return depths;
  const double share = solver.steps() > 0 ? 1 : 0;
  const PlacedObstacles after = solver.method() == Method::equilibrium
                                    ? obstacles_after(model, share, share)
                                    : PlacedObstacles{};
  const std::vector<LayerGroup> groups = groups_of(model, model.contact);
  const PlacedLayer layer(model, groups, [&](Index i) { return state.displacement[i]; });
  const PlacedObstacles now =
      after.empty() ? obstacles_now(model, solver.time(), 0, state.rigid) : after;
  for (std::size_t o = 0; o < depths.size(); ++o) {
    const Obstacle& obstacle = model.obstacles[o];
    layer.for_each_inside(obstacle, now[o], [&](std::size_t k, Vec3d, const Gap& gap) {
      depths[o].keep(-gap.distance, model.neighbourhood.support[model.contact.phyxels[k]]);
    });
    depths[o] = of_all_ranks(model, depths[o]);
  }
  return depths;
}

/// The first part of a body of the scene.
const Part& first_part(const Model& model, std::size_t body) {
  return *std::find_if(model.parts.begin(), model.parts.end(), [&](const Part& part) {
    return static_cast<std::size_t>(part.body) == body;
  });
}

/// The depth at which a run ends, in supports: of phyxels in obstacles, and in other bodies.
constexpr double in_obstacle = 0.25, in_body = 1;

/// Refuses phyxels that supports have led deep into something that cannot give way, either.
void check_held(const Model& model, const HeldOverlaps& overlaps) {
  const auto check = [&](const HeldOverlap& overlap, double allowed, const std::string& where) {
    if (!(overlap.share() > allowed)) return;
    say_diverged(
        model, fmt::format("phyxels of body \"{}\" that supports hold or move are {:.3g} m deep in "
                           "{}, {:.3g} m is allowed, {} of a support: supports press into each "
                           "other what cannot give way; allowed: motions (body.motion, "
                           "obstacle.motion) that leave them room",
                           name_of_body(model, overlap.body), overlap.depth, where,
                           allowed * overlap.support, allowed));
  };
  for (const HeldOverlap& overlap : overlaps.of_bodies) {
    if (overlap.depth == 0) continue;
    check(overlap, in_body,
          fmt::format("held ones of body \"{}\"", name_of_body(model, overlap.other)));
  }
  for (std::size_t o = 0; o < overlaps.of_obstacles.size(); ++o) {
    check(overlaps.of_obstacles[o], in_obstacle,
          fmt::format("obstacle \"{}\"", model.obstacles[o].name));
  }
}

/// What else may have led phyxels into an obstacle, for the message: a free body that they cannot
/// push, since supports hold them along its normal.
std::string held_in_part(const Model& model, const std::string& obstacle) {
  const bool is_free =
      std::any_of(model.obstacles.begin(), model.obstacles.end(), [&](const Obstacle& each) {
        return each.free && each.name == obstacle && !(each.penalty > 0);
      });
  const bool some_are_held = std::any_of(model.motions.begin(), model.motions.end(),
                                         [](const Motion& motion) { return !motion.axes.all(); });
  if (!is_free || !some_are_held) return "";
  return ", or supports hold them along its normal but not along all axes, and then they cannot "
         "push "
         "a free body (allowed there: method = \"penalty\" of the obstacle)";
}

/// Refuses readings of phyxels that an obstacle has left inside another one, or that it cannot
/// hold.
void check_depths(const Model& model, const std::vector<ContactReading>& readings) {
  for (const ContactReading& reading : readings) {
    const bool is_body = reading.shape == body_shape;
    const double allowed = is_body ? in_body : in_obstacle;
    if (!(reading.depth_share > allowed)) continue;
    const std::string whose = is_body ? fmt::format(" of body \"{}\"", reading.obstacle) : "";
    const std::string where = !is_body ? fmt::format("obstacle \"{}\"", reading.obstacle)
                              : model.body_contact.self ? "other bodies or other parts of it"
                                                        : "other bodies";
    say_diverged(
        model, fmt::format("phyxels{} are up to {:.3g} m deep in {}, {:.3g} of {}, {} of it is "
                           "allowed: something presses them into it, or they are too fast for the "
                           "step{}{}",
                           whose, reading.depth, where, reading.depth_share,
                           is_body ? "the smaller support of both" : "their support", allowed,
                           has_penalties(model) ? ", or penalties are too soft (stiffness)" : "",
                           is_body ? "" : held_in_part(model, reading.obstacle)));
  }
}

}  // namespace

const char* shape_name(const Obstacle& obstacle) {
  return ObstacleShapes::with(
      obstacle.form, [](const auto& shape) { return std::decay_t<decltype(shape)>::name; });
}

std::vector<ContactReading> find_contacts(const Model& model, Backend& backend,
                                          const Solver& solver) {
  check_fits(model, backend);
  if (touching_count(model) == 0) return {};
  const HeldOverlaps held = find_held_overlaps(model, solver, backend.rigid_states());
  check_held(model, held);
  State state;
  ContactRates rates = rates_now(model, backend, solver, state);
  add_over_ranks(model, rates.sums);
  StepSums all = no_step_sums(model);
  add_words(all, solver.step_sums());
  std::vector<ContactReading> readings;
  const auto add = [&](ContactReading reading) {
    constexpr std::size_t count = ContactTerms::count;
    const std::size_t first = readings.size() * count;
    const std::span<const ExactSum> step = std::span(rates.sums).subspan(first, count);
    const std::span<const ExactSum> sums =
        std::span(all).subspan(sums_of_motions(model) + first, count);
    reading.force = vector_of(step.subspan(ContactTerms::impulse, 3)) / rates.span;
    reading.torque = vector_of(step.subspan(ContactTerms::moment, 3)) / rates.span;
    reading.impulse = vector_of(sums.subspan(ContactTerms::impulse, 3));
    reading.angular_impulse = vector_of(sums.subspan(ContactTerms::moment, 3));
    reading.work = sums[ContactTerms::work].value();
    reading.friction_heat = sums[ContactTerms::friction_heat].value();
    reading.impact_loss = sums[ContactTerms::impact_loss].value();
    readings.push_back(std::move(reading));
  };
  const std::vector<Depth> depths = depths_in_obstacles(model, solver, state);
  for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
    const Obstacle& obstacle = model.obstacles[o];
    add({.obstacle = obstacle.name,
         .shape = shape_name(obstacle),
         .depth = depths[o].depth,
         .depth_share = depths[o].share,
         .place = obstacle.place});
  }
  const std::size_t bodies = model.body_contact.distances.size();
  for (std::size_t b = 0; b < bodies; ++b) {
    const Part& part = first_part(model, b);
    Depth depth;
    if (!rates.depths.empty()) depth = {rates.depths[b], rates.depths[bodies + b]};
    depth = of_all_ranks(model, depth);
    add({.obstacle = part.name,
         .shape = body_shape,
         .depth = depth.depth,
         .depth_share = depth.share,
         .place = part.centre});
  }
  check_depths(model, readings);
  const auto add_held = [&](const std::vector<HeldOverlap>& overlaps, std::size_t first) {
    for (std::size_t k = 0; k < overlaps.size(); ++k) {
      ContactReading& reading = readings[first + k];
      reading.depth = std::max(reading.depth, overlaps[k].depth);
      reading.depth_share = std::max(reading.depth_share, overlaps[k].share());
    }
  };
  add_held(held.of_obstacles, 0);
  add_held(held.of_bodies, model.obstacles.size());
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
