/// Bodies that move: the bar's frequencies, a free body that spins.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

constexpr double safety = 0.8;  ///< Of the step limit.

/// A body and its steps.
struct Motions {
  Clock::time_point begin = Clock::now();  ///< Of the set-up: the first member.
  Cloud cloud;
  Model model;
  std::unique_ptr<Backend> backend;
  double dt = 0;  ///< [s]

  explicit Motions(const Scene& scene)
      : cloud(make_cloud(scene.bodies[0])), model(build_model(scene, std::span(&cloud, 1))) {
    backend = make_cpu_backend(model, Precision::double_);
    dt = safety * step_limit(model).largest_step;
  }
  Solution solution(Clock::time_point start, std::int64_t steps,
                    std::vector<Quantity> found) const {
    return {.phyxels = model.size(),
            .neighbours = static_cast<double>(model.pairs()) / model.size(),
            .evaluations = steps,
            .seconds = seconds_since(start),
            .setup_seconds = std::chrono::duration<double>(start - begin).count(),
            .found = std::move(found)};
  }
};

/// The frequency of a signal about zero, by the times at which it rises through zero [Hz].
class Crossings {
 public:
  void add(double time, double value) {
    if (before_ < 0 && value >= 0) {
      const double at = before_time_ + (time - before_time_) * before_ / (before_ - value);
      if (count_++ == 0) first_ = at;
      last_ = at;
    }
    before_ = value;
    before_time_ = time;
  }
  int count() const { return count_; }
  double frequency() const { return (count_ - 1) / (last_ - first_); }

 private:
  double before_ = 0, before_time_ = 0, first_ = 0, last_ = 0;
  int count_ = 0;
};

/// The clamped bar, set in motion near one of its modes, over ten periods.
/// @param velocity at rest position x [m/s], small
/// @param signal of the end's phyxels
Solution ringing(const Discretisation& d, double reference,
                 const std::function<Vec3d(Vec3d)>& velocity,
                 const std::function<double(const Motions&, const State&)>& signal) {
  constexpr int periods = 10;
  const Motions m(clamped(bar(d, 1, 0.2)));
  State state;
  state.dt = m.dt;
  for (const Vec3d& x : m.model.position) state.velocity.push_back(velocity(x));
  for (const Motion& held : m.model.motions) {
    for (const Index i : held.phyxels) state.velocity[i] = {};
  }
  state.displacement.resize(state.velocity.size());
  const auto start = Clock::now();
  Solver solver(*m.backend, state);
  Crossings crossings;
  // Looked at a hundred times a period.
  const auto look = std::max<std::int64_t>(1, static_cast<std::int64_t>(0.01 / reference / m.dt));
  const auto most = static_cast<std::int64_t>(2 * (periods + 2) / reference / m.dt);
  while (crossings.count() <= periods && solver.steps() < most) {
    for (std::int64_t s = 0; s < look; ++s) solver.step();
    crossings.add(solver.time(), signal(m, solver.state()));
  }
  const double found = crossings.count() > periods ? crossings.frequency() : 0;
  return m.solution(start, solver.steps(), {{"frequency", found, reference}});
}

const std::vector<Index>& end_of(const Motions& m) { return m.cloud.regions.at("x+"); }

Solution bending(const Discretisation& d) {
  return ringing(
      d, 1.00097,
      [](Vec3d x) {
        return Vec3d{0, 0, 1e-3 * x.x * x.x * (3 - x.x) / 2};
      },
      [](const Motions& m, const State& s) {
        return mean_of(m.model, end_of(m), s.displacement).z;
      });
}
Solution torsion(const Discretisation& d) {
  return ringing(
      d, 4.52029,
      [](Vec3d x) {
        return 1e-2 * std::sin(std::numbers::pi / 2 * x.x) * Vec3d{0, -x.z, x.y};
      },
      [](const Motions& m, const State& s) {
        double turn = 0;
        for (const Index i : end_of(m)) {
          const Vec3d &x = m.model.position[i], &u = s.displacement[i];
          turn += m.model.volume[i] * (x.y * u.z - x.z * u.y);
        }
        return turn;
      });
}
Solution stretching(const Discretisation& d) {
  return ringing(
      d, 7.952,
      [](Vec3d x) {
        return Vec3d{1e-3 * std::sin(std::numbers::pi / 2 * x.x), 0, 0};
      },
      [](const Motions& m, const State& s) {
        return mean_of(m.model, end_of(m), s.displacement).x;
      });
}

/// Tumbling about an axis near the middle one, fast enough to be strained by a percent.
Solution spinning(const Discretisation& d) {
  constexpr int looks = 1000;
  const std::int64_t each = 1000;  // steps
  BodyRequest body;
  body.name = "block";
  body.where = "phyxel accuracy";
  body.source.shape = {.name = "block",
                       .size = {0.3, 0.2, 0.1},
                       .spacing = 0.2 / d.across,
                       .jitter = d.jitter,
                       .placement = d.placement,
                       .surface = d.closure > 0};
  body.material = {.young = E, .poisson = nu, .density = rho, .hourglass = d.hourglass};
  body.neighbourhood.factor = d.factor;
  body.closure = d.closure;
  body.spin = {0.5, 30, 1};
  Scene scene;
  scene.bodies.push_back(body);
  const Motions m(scene);
  const auto start = Clock::now();
  Solver solver(*m.backend, initial_state(m.model, scene, m.dt));
  const auto look = [&] { return diagnose(m.model, *m.backend, solver.steps(), m.dt); };
  const Diagnostics first = look();
  // The body springs out at first, and its energy with the step's error: means of a hundred looks.
  double early = 0, late = 0, turned = 0, pushed = 0, speed = 0;
  for (int k = 0; k < looks; ++k) {
    for (std::int64_t s = 0; s < each; ++s) solver.step();
    const Diagnostics now = look();
    if (now.bad_phyxel >= 0) {  // it has flown apart: nothing stays
      turned = pushed = late = HUGE_VAL;
      break;
    }
    if (k < looks / 10) early += now.total_energy();
    if (k >= looks - looks / 10) late += now.total_energy();
    turned = std::max(turned, norm(now.angular_momentum - first.angular_momentum));
    pushed = std::max(pushed, norm(now.momentum));
    speed = std::max(speed, now.largest_speed);
  }
  return m.solution(start, solver.steps(),
                    {{"drift of energy", std::abs(late / early - 1)},
                     {"change of angular momentum", turned / norm(first.angular_momentum)},
                     {"momentum by mass and speed", pushed / (m.model.parts[0].mass * speed)}});
}

}  // namespace

std::vector<AccuracyCase> dynamic_cases() {
  return {
      {"bending",
       "The bar of the gravity case, clamped, without weight, rings in bending. Reference: the "
       "same "
       "finite elements, 20 × 4 × 4.",
       {4, 6, 8},
       bending},
      {"torsion", "It rings in torsion. Reference: the same elements.", {4, 6, 8}, torsion},
      {"stretching",
       "It rings along its axis. Reference: the same elements.",
       {4, 6, 8},
       stretching},
      {"spinning",
       "A free block, 3 : 2 : 1, tumbles about its middle axis for a million steps of 0.8 of the "
       "limit, strained by a percent: momenta and energy are to stay. Energy is the mean of a "
       "hundred looks at the beginning and at the end.",
       {4},
       spinning},
  };
}

std::vector<AccuracyCase> accuracy_cases() {
  std::vector<AccuracyCase> all = static_cases(), moving = dynamic_cases();
  all.insert(all.end(), moving.begin(), moving.end());
  return all;
}

}  // namespace phyxel::app
