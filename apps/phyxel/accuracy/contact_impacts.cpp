/// Problems of bodies that hit each other: bars and balls.
#include <algorithm>
#include <cmath>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "accuracy/touching.hpp"
#include "phyxel/physics/laws.hpp"

namespace phyxel::app {
namespace {

/// History of a body's momentum along x, one value per step.
class Push {
 public:
  explicit Push(double dt) : dt_(dt) {}
  void add(double momentum) { momentum_.push_back(momentum); }
  /// The time from the first step with a force above `least` [N] to the last one [s].
  double duration(double least) const {
    std::size_t first = 0, last = 0;
    for (std::size_t k = 1; k < momentum_.size(); ++k) {
      if (momentum_[k] - momentum_[k - 1] <= least * dt_) continue;
      if (first == 0) first = k;
      last = k;
    }
    return first == 0 ? 0 : static_cast<double>(last - first + 1) * dt_;
  }
  /// The mean force between two times [N].
  double force(double from, double to) const {
    const auto a = static_cast<std::size_t>(from / dt_), b = static_cast<std::size_t>(to / dt_);
    return (momentum_.at(b) - momentum_.at(a)) / (static_cast<double>(b - a) * dt_);
  }

 private:
  double dt_;
  std::vector<double> momentum_{0};
};

constexpr double side = 0.2, first_length = 1;  // of bars [m]

/// Simulates two bars that meet end to end.
/// @param second_length [m]
Solution meeting_bars(const Discretisation& d, double second_length) {
  const double speed_of_sound = std::sqrt(E / rho), speed = 1e-3 * speed_of_sound;
  const double wave = 2 * first_length / speed_of_sound;  // there and back in the first bar [s]
  Scene scene;
  scene.bodies = {contact_body(d, "first", 0), contact_body(d, "second", 0)};
  scene.bodies[0].velocity = {speed, 0, 0};
  scene.contact.emplace();
  Touching bars(scene, [&] {
    const auto bar_from = [&](double x, double length) {
      return moved_cloud(block_cloud(d, {length, side, side}, side / d.across),
                         {x + 0.5 * length, 0, 0});
    };
    return std::vector<Cloud>{bar_from(-first_length, first_length), bar_from(0, second_length)};
  });
  const Diagnostics before = diagnose(bars.model(), bars.backend(), bars.solver());
  Push push(bars.dt());
  // Of a longer second bar, until the wave has come back from its end.
  const double end = wave * (second_length / first_length + 0.5);
  while (bars.solver().time() < end) {
    bars.solver().step();
    push.add(bars.model().parts[1].mass * bars.velocity(1).x);
  }
  const Diagnostics after = diagnose(bars.model(), bars.backend(), bars.solver());
  const double force = rho * speed_of_sound * side * side * speed / 2;
  std::vector<Quantity> found;
  if (second_length == first_length) {
    found = {{"time of contact", push.duration(0.01 * force), wave},
             {"force", push.force(0.25 * wave, 0.75 * wave), force},
             {"speed of the second", bars.velocity(1).x, speed}};
  } else {
    found = {{"restitution", (bars.velocity(1).x - bars.velocity(0).x) / speed,
              first_length / second_length}};
  }
  found.push_back(
      {"energy", after.kinetic_and_elastic_energy(), before.kinetic_and_elastic_energy()});
  return bars.solution(std::move(found));
}

Solution equal_bars(const Discretisation& d) { return meeting_bars(d, first_length); }
Solution unequal_bars(const Discretisation& d) { return meeting_bars(d, 2 * first_length); }

/// Simulates two equal balls that meet.
Solution meeting_balls(const Discretisation& d) {
  constexpr double radius = 0.1;
  const double speed_of_sound = std::sqrt(E / rho), speed = 0.02 * speed_of_sound;
  // Of ball_on_planes.py, in units of R √(ρ/E) and R.
  const double duration = 11.398 * radius / speed_of_sound, approach = 0.07820 * radius;
  Scene scene;
  scene.bodies = {contact_body(d, "left", nu), contact_body(d, "right", nu)};
  for (BodyRequest& body : scene.bodies) body.material.law = SmallStrain<double>::name;
  scene.bodies[0].velocity = {0.5 * speed, 0, 0};
  scene.bodies[1].velocity = {-0.5 * speed, 0, 0};
  scene.contact.emplace();
  Touching balls(scene, [&] {
    const Cloud ball = ball_cloud(d, radius);
    return std::vector<Cloud>{moved_cloud(ball, {-radius, 0, 0}),
                              moved_cloud(ball, {radius, 0, 0})};
  });
  const double mass = balls.model().parts[1].mass;
  Push push(balls.dt());
  double nearest = 0;
  while (balls.solver().time() < 1.5 * duration) {
    balls.solver().step();
    push.add(mass * (balls.velocity(1).x + 0.5 * speed));
    nearest = std::max(nearest, balls.moved(0).x - balls.moved(1).x);
  }
  // The mean force is that which turns the ball's speed.
  const double force = mass * speed / duration;
  return balls.solution({{"time of contact", push.duration(1e-6 * force), duration},
                         {"approach", nearest, approach},
                         {"restitution", (balls.velocity(1).x - balls.velocity(0).x) / speed, 1}});
}

}  // namespace

std::vector<AccuracyCase> contact_impacts() {
  return {
      {.name = "bars",
       .what =
           "A bar, five times as long as wide, ν = 0, hits an equal one at rest end to end, at a "
           "thousandth of the speed of sound c. References, of plane waves: they touch for 2 L/c, "
           "push each other with ρ c A V/2, and exchange their velocities (Goldsmith 1960). The "
           "force is a mean over the middle half of 2 L/c; energy is the kinetic and elastic one "
           "after the impact, beside that before. The layers that meet lose what an inelastic "
           "impact of half a layer does, which is of first order in the spacing, as are all errors "
           "but that of the force: the bars part later, and with some vibration. Irregular clouds "
           "without closed gradients are softer, and waves in them slower.",
       .across = {4, 8, 12},
       .solve = equal_bars,
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}},
      {.name = "unequal-bars",
       .what =
           "The bar hits one that is twice as long: it stops, and the long one moves at half of "
           "its "
           "speed, so that the restitution is ½ without any loss (Saint-Venant). It is measured "
           "after the wave has come back from the far end of the long bar.",
       .across = {4, 6, 8},
       .solve = unequal_bars,
       .hourglass = {0.1},
       .fillings = {Filling::nodes, Filling::mesh}},
      {.name = "balls",
       .what =
           "Two equal balls, ν = 0.3, meet at 0.02 √(E/ρ): time of contact, largest approach of "
           "their centres of mass, and restitution. The radius of contact reaches 0.2 R: 1.2, 1.6 "
           "and 2.4 spacings. Strains are small ones. References: 11.398 R √(ρ/E) and 0.0782 R, "
           "from "
           "the force law of the same ball in balance with its inertia, by axisymmetric finite "
           "elements (`bench/references/ball_on_planes.py`; ± 0.1%, without the vibrations of the "
           "ball). Hertz's formula, 2.868 (m*²/(R* E*² V))^⅕, which takes the balls for infinite "
           "bodies, gives 12.305, 8% more, and an approach that is 7% more. Cells make a surface "
           "of "
           "steps, and converge slowly.",
       .across = {12, 16, 24},
       .solve = meeting_balls,
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = {Filling::cells, Filling::mesh}}};
}

}  // namespace phyxel::app
