/// The check of speeds at which bodies and obstacles might pass through each other in a step.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/parts.hpp"
#include "model/rigid_tips.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/held_overlaps.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/say_diverged.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {
namespace {

/// Ends a run in which the state of a free body is not finite.
void check_rigid(const Model& model, std::span<const RigidState> rigid) {
  const std::vector<std::size_t> bodies = free_bodies(model);
  for (std::size_t k = 0; k < rigid.size(); ++k) {
    const auto numbers = rigid[k].numbers();
    if (std::all_of(numbers.begin(), numbers.end(), [](double n) { return std::isfinite(n); })) {
      continue;
    }
    say_diverged(
        model,
        fmt::format("the simulation diverged: the state of the free body \"{}\" is not finite; "
                    "it is too light for what it touches, or turns by more than a radian in a "
                    "step: allowed is a smaller time.step",
                    model.obstacles[bodies[k]].name));
  }
}

/// The smallest support of the phyxels by which each body of the scene touches others [m]; infinite
/// for those that touch nothing. Of a share: of its own phyxels.
std::vector<double> supports_of_bodies(const Model& model) {
  std::vector<double> smallest(count_of_bodies(model), HUGE_VAL);
  for (const ContactLayer* layer : {&model.contact, &model.body_contact.layer}) {
    for (const Index i : layer->phyxels) {
      double& of_body = smallest[part_of(model, i).body];
      of_body = std::min(of_body, model.neighbourhood.support[i]);
    }
  }
  for (const HeldPoint& point : model.held_points) {
    double& of_body = smallest[body_of_id(model, point.id)];
    of_body = std::min(of_body, point.support);
  }
  return smallest;
}

/// The speed of the fastest waves in a body [m/s].
double fastest_waves(const Model& model, Index body) {
  double fastest = 0;
  for (const Part& part : model.parts) {
    if (part.body == body) fastest = std::max(fastest, pressure_wave_speed(part.material));
  }
  return fastest;
}

/// The bodies of a model that may be too fast.
struct FastBodies {
  std::vector<double> support;  ///< Of each body, as of `supports_of_bodies` [m].
  std::vector<double> speed;    ///< The largest one of each body [m/s].
  double dt = 0;                ///< [s]
};

/// Refuses a pair of bodies, which may be the same one, that is too fast.
void check_pair(const Model& model, const FastBodies& all, Index a, Index b) {
  const double support = std::min(all.support[a], all.support[b]);
  const double speed = all.speed[a] + all.speed[b], way = speed * all.dt;
  if (!(way > 0.5 * support)) return;
  const std::string pair = fmt::format(
      "phyxels of bodies \"{}\" and \"{}\" move at up to {:.3g} "
      "and {:.3g} m/s",
      name_of_body(model, a), name_of_body(model, b), all.speed[a], all.speed[b]);
  // No impact that a step resolves does this.
  const double waves = std::max(fastest_waves(model, a), fastest_waves(model, b));
  const double largest = std::max(all.speed[a], all.speed[b]);
  if (largest > 100 * waves) {
    say_diverged(model,
                 fmt::format("{}, {:.2g} times as fast as waves in these bodies: something presses "
                             "phyxels into each other that cannot give way, such as those of "
                             "supports; allowed: motions that leave them room",
                             pair, largest / waves));
  }
  say_diverged(
      model, fmt::format("{}, so that they may move by {:.3g} m against each other in a step of "
                         "{:.3g} s: they might pass through each other unseen; allowed: {:.3g} m, "
                         "half of their smallest support, by a step of at most {:.3g} s "
                         "(time.step, time.safety), or lower speeds",
                         pair, way, all.dt, 0.5 * support, 0.5 * support / speed));
}

void check_bodies(const Model& model, const FastBodies& all) {
  const auto count = static_cast<Index>(all.speed.size());
  for (Index a = 0; a < count; ++a) {
    for (Index b = a; b < count; ++b) {
      if (model.body_contact.law_of(a, b)) check_pair(model, all, a, b);
    }
  }
}

/// Refuses a body that is too fast for an obstacle. @param of_obstacle largest speed of that [m/s]
void check_beside(const Model& model, const FastBodies& all, Index body, const Obstacle& obstacle,
                  double of_obstacle) {
  const double radius = obstacle.inner_radius(), support = all.support[body];
  const double speed = all.speed[body] + of_obstacle;
  const double most = 0.5 * std::min(radius, support);
  if (!(speed * all.dt > most) || support == HUGE_VAL) return;
  say_diverged(
      model,
      fmt::format("phyxels of body \"{}\" move at up to {:.3g} m/s and obstacle \"{}\" at {:.3g} "
                  "m/s, {:.3g} m against each other in a step of {:.3g} s: they might pass through "
                  "each other unseen; allowed: {:.3g} m, half of {}, by a step of at most {:.3g} s "
                  "(time.step, time.safety), lower speeds, or a thicker obstacle",
                  name_of_body(model, body), all.speed[body], obstacle.name, of_obstacle,
                  speed * all.dt, all.dt, most,
                  radius < support ? "the obstacle's inner radius" : "a support of the phyxels",
                  most / speed));
}

}  // namespace

void check_contact_speeds(const Model& model, const Solver& solver, double largest_speed,
                          const std::function<std::vector<double>()>& speeds_of_bodies,
                          std::span<const RigidState> rigid) {
  check_rigid(model, rigid);
  if (touching_count(model) == 0 || solver.method() == Method::equilibrium) return;
  const PlacedObstacles placed = obstacles_now(model, solver.time(), solver.dt(), rigid);
  FastBodies all{.support = supports_of_bodies(model), .speed = {}, .dt = solver.dt()};
  double least = *std::min_element(all.support.begin(), all.support.end());
  if (model.share) least = model.share->communicator->smallest(least);
  // If no pair of the smallest supports and the largest speeds is too fast, none is.
  bool some = model.body_contact.acts() && 2 * largest_speed * all.dt > 0.5 * least;
  std::vector<double> of_obstacle;
  for (std::size_t o = 0; o < placed.size(); ++o) {
    of_obstacle.push_back(model.obstacles[o].largest_speed(placed[o]));
    const double most = 0.5 * std::min(model.obstacles[o].inner_radius(), least);
    some = some || (largest_speed + of_obstacle[o]) * all.dt > most;
  }
  if (!some) return;
  all.speed = speeds_of_bodies();
  for (double& support : all.support) {
    if (model.share) support = model.share->communicator->smallest(support);
  }
  if (model.body_contact.acts()) check_bodies(model, all);
  for (std::size_t o = 0; o < placed.size(); ++o) {
    for (Index b = 0; b < static_cast<Index>(all.speed.size()); ++b) {
      check_beside(model, all, b, model.obstacles[o], of_obstacle[o]);
    }
  }
}

}  // namespace phyxel
