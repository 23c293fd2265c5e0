/// Problems of moving bodies: frequencies of a bar, and free bodies.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <random>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/solver.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

constexpr double safety = 0.8;  ///< Time step over the stability limit.

/// A body and its steps.
struct Motions {
  Clock::time_point begin = Clock::now();  ///< Begin of the set-up; must be the first member.
  Cloud cloud;
  Model model;
  std::unique_ptr<Backend> backend;
  double dt = 0;  ///< Time step [s].

  Motions(const Scene& scene, const Discretisation& d)
      : Motions(scene, [&] { return cloud_of(scene, d); }) {}
  /// @param make function that returns the body's cloud
  template <class Make>
  Motions(const Scene& scene, Make&& make)
      : cloud(make()), model(build_model(scene, std::span(&cloud, 1))) {
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

/// The frequency of a signal from its upward zero crossings [Hz].
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

/// Solves for the frequency of the clamped bar, started near one of its modes, over ten periods.
/// @param velocity initial velocity at rest position x [m/s], small
/// @param signal observed signal, from the end's phyxels
Solution ringing(const Discretisation& d, double reference,
                 const std::function<Vec3d(Vec3d)>& velocity,
                 const std::function<double(const Motions&, const State&)>& signal) {
  constexpr int periods = 10;
  const Motions m(clamped(bar(d, 1, 0.2)), d);
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
  // The signal is sampled a hundred times a period.
  const auto look = std::max<std::int64_t>(1, static_cast<std::int64_t>(0.01 / reference / m.dt));
  const auto most = static_cast<std::int64_t>(2 * (periods + 2) / reference / m.dt);
  while (crossings.count() <= periods && solver.steps() < most) {
    solver.step(look);
    crossings.add(solver.time(), signal(m, solver.state()));
  }
  const double found = crossings.count() > periods ? crossings.frequency() : 0;
  return m.solution(start, solver.steps(), {{"frequency", found, reference}});
}

const std::vector<Index>& end_of(const Motions& m) { return m.cloud.regions.at("x+"); }

Solution bending(const Discretisation& d) {
  return ringing(
      d, 0.99945,
      [](Vec3d x) {
        return Vec3d{0, 0, 1e-3 * x.x * x.x * (3 - x.x) / 2};
      },
      [](const Motions& m, const State& s) {
        return mean_of(m.model, end_of(m), s.displacement).z;
      });
}
Solution torsion(const Discretisation& d) {
  return ringing(
      d, 4.5173,
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
      d, 7.9471,
      [](Vec3d x) {
        return Vec3d{1e-3 * std::sin(std::numbers::pi / 2 * x.x), 0, 0};
      },
      [](const Motions& m, const State& s) {
        return mean_of(m.model, end_of(m), s.displacement).x;
      });
}

/// The largest and smallest values of a signal, by parabolas through three looks.
class Peaks {
 public:
  void add(double value) {
    const double rise = last_ - before_, fall = last_ - value;
    if (count_++ > 1 && rise * fall > 0) {
      const double slope = 0.5 * (value - before_), bend = value - 2 * last_ + before_;
      sizes_.push_back(std::abs(last_ - 0.5 * slope * slope / bend));
    }
    before_ = last_;
    last_ = value;
  }
  const std::vector<double>& sizes() const { return sizes_; }

 private:
  std::vector<double> sizes_;
  double before_ = 0, last_ = 0;
  int count_ = 0;
};

/// The bar of `stretching`, with viscosity: how much smaller each swing is than the one before.
Solution damped(const Discretisation& d) {
  constexpr double frequency = 7.9471, omega = 2 * std::numbers::pi * frequency;  // undamped
  constexpr double share = 0.02;                                                  // of critical
  constexpr int first = 4, last = 20;  // half periods, between which higher modes are gone
  Scene scene = clamped(bar(d, 1, 0.2));
  scene.bodies[0].material.viscosity = 2 * share / omega;
  const Motions m(scene, d);
  State state;
  state.dt = m.dt;
  for (const Vec3d& x : m.model.position) {
    state.velocity.push_back({1e-3 * std::sin(std::numbers::pi / 2 * x.x), 0, 0});
  }
  state.displacement.resize(state.velocity.size());
  const auto start = Clock::now();
  Solver solver(*m.backend, state);
  Peaks peaks;
  const auto look = std::max<std::int64_t>(1, static_cast<std::int64_t>(0.01 / frequency / m.dt));
  while (peaks.sizes().size() <= last && solver.time() * frequency < last) {
    solver.step(look);
    peaks.add(mean_of(m.model, m.cloud.regions.at("x+"), solver.state().displacement).x);
  }
  const bool rang = peaks.sizes().size() > last;
  const double periods = 0.5 * (last - first);
  const double decrement =
      rang ? std::log(peaks.sizes()[first] / peaks.sizes()[last]) / periods : 0;
  const double known = 2 * std::numbers::pi * share / std::sqrt(1 - share * share);
  return m.solution(start, solver.steps(), {{"decrement", decrement, known}});
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
                       .placement = placement_of(d.filling),
                       .surface = d.closure > 0};
  body.material = {
      .young = E, .poisson = nu, .density = rho, .law = d.law, .hourglass = d.hourglass};
  body.neighbourhood.factor = d.factor;
  body.closure = d.closure;
  body.spin = {0.5, 30, 1};
  Scene scene;
  scene.bodies.push_back(body);
  const Motions m(scene, d);
  const auto start = Clock::now();
  Solver solver(*m.backend, initial_state(m.model, scene, m.dt));
  const auto look = [&] { return diagnose(m.model, *m.backend, solver.steps(), m.dt); };
  const Diagnostics first = look();
  // The body expands at first, and its energy oscillates with the error of the step, so that means
  // of a hundred samples are compared.
  double early = 0, late = 0, turned = 0, pushed = 0, speed = 0;
  for (int k = 0; k < looks; ++k) {
    solver.step(each);
    const Diagnostics now = look();
    if (now.bad_phyxel >= 0) {  // the body has diverged
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

// --- an L-shaped block ---------------------------------------------------------------------------

/// Width and length of the arms of the L [m]: a lattice without a corner, or a filled surface.
constexpr double arm = 1, reach = 3;  // [m]

/// The surface of the prism of the L.
Surface l_surface() {
  const double corners[6][2] = {{0, 0},     {reach, 0},   {reach, arm},
                                {arm, arm}, {arm, reach}, {0, reach}};
  const Triangle cap[] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
  Surface surface;
  for (const double z : {0.0, arm}) {
    for (const auto& [x, y] : corners) surface.position.push_back({x, y, z});
  }
  for (const Triangle& t : cap) {
    surface.triangle.push_back({t[0], t[2], t[1]});
    surface.triangle.push_back({t[0] + 6, t[1] + 6, t[2] + 6});
  }
  for (Index k = 0; k < 6; ++k) {
    const Index next = (k + 1) % 6;
    surface.triangle.push_back({k, next, next + 6});
    surface.triangle.push_back({k, next + 6, k + 6});
  }
  surface.normal = vertex_normals(surface.position, surface.triangle);
  return surface;
}

/// True if a point is inside the L, not on its surface.
bool in_l(Vec3d p) {
  return std::min({p.x, p.y, p.z}) > 0 && std::max(p.x, p.y) < reach && p.z < arm &&
         (p.x < arm || p.y < arm);
}

Cloud l_cloud(const Discretisation& d) {
  const double s = arm / d.across;
  const bool cells = d.filling == Filling::cells;
  const int along = static_cast<int>(std::lround(reach * d.across)) + !cells,
            deep = d.across + !cells;
  std::mt19937_64 engine(1);
  const auto random = [&] { return static_cast<double>(engine() >> 11) * 0x1p-52 - 1; };
  Cloud cloud;
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < along; ++j) {
      for (int k = 0; k < deep; ++k) {
        Vec3d p =
            s * (Vec3d{static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)} +
                 (cells ? 0.5 : 0.0) * Vec3d{1, 1, 1});
        // A node gets an eighth of the volume of each adjacent cell.
        int around = 0;
        for (int corner = 0; corner < 8; ++corner) {
          const auto half = [&](int bit) { return corner & bit ? 0.25 * s : -0.25 * s; };
          around += in_l(p + Vec3d{half(1), half(2), half(4)});
        }
        if (around == 0) continue;
        // Nodes on the surface are not jittered.
        if (d.jitter > 0 && around == 8) p += d.jitter * s * Vec3d{random(), random(), random()};
        cloud.position.push_back(p);
        cloud.volume.push_back(s * s * s * around / 8);
      }
    }
  }
  if (d.filling == Filling::mesh) {
    cloud = sample_surface(
        l_surface(), {.phyxels = static_cast<Index>(cloud.position.size()), .on_surface = true});
  }
  cloud.surface = d.closure > 0 ? l_surface() : Surface{};
  order_along_curve(cloud);
  return cloud;
}

constexpr double pushed_for = 5;  ///< Duration of the load [s].

/// Changes of conserved quantities.
struct Changes {
  double momentum = 0;  ///< Largest momentum [kg m/s].
  double turned = 0;    ///< Largest change of angular momentum, relative to its initial value.
  double drift = 0;     ///< Drift of energy, relative to its initial value.
  std::int64_t steps = 0;
};

/// Steps a body under load, and then free.
Changes free_motion(const Motions& under_load, const Motions& free, const Scene& scene, double dt,
                    std::int64_t steps) {
  constexpr int looks = 1000;
  Solver first(*under_load.backend, initial_state(under_load.model, scene, dt));
  while (first.time() < pushed_for) first.step();
  Solver solver(*free.backend, first.state());
  const auto look = [&] { return diagnose(free.model, *free.backend, solver.steps(), dt); };
  const Diagnostics begin = look();
  double early = 0, late = 0, turned = 0;
  for (int k = 0; k < looks; ++k) {
    solver.step(steps / looks);
    const Diagnostics now = look();
    if (now.bad_phyxel >= 0) {
      turned = late = HUGE_VAL;
      break;
    }
    if (k < looks / 10) early += now.total_energy();
    if (k >= looks - looks / 10) late += now.total_energy();
    turned = std::max(turned, norm(now.angular_momentum - begin.angular_momentum));
  }
  return {norm(look().momentum), turned / norm(begin.angular_momentum), std::abs(late / early - 1),
          first.steps() + steps};
}

/// Solves an L-shaped block that is pushed at the ends of its arms and then moves freely. Source of
/// the problem: Simo and Tarnow 1992, whose load is a triangle in time of the same impulse.
Solution l_block(const Discretisation& d) {
  const Vec3d push = 1.25 * Vec3d{150, 300, 450};  // [N]
  BodyRequest body;
  body.name = "L";
  body.where = "phyxel accuracy";
  body.material = {
      .young = 50046, .poisson = nu, .density = rho, .law = d.law, .hourglass = d.hourglass};
  body.neighbourhood.factor = d.factor;
  body.closure = d.closure;
  Scene scene;
  const double layer = d.filling == Filling::cells ? 0.51 * arm / d.across : 1e-5 * arm;
  constexpr double far = 10 * reach;
  body.loads.push_back(
      {.select = {.box = Selection::Box{{reach - layer, -far, -far}, {far, far, far}}},
       .force = push});
  body.loads.push_back(
      {.select = {.box = Selection::Box{{-far, reach - layer, -far}, {far, far, far}}},
       .force = -1.0 * push});
  scene.bodies.push_back(body);
  const Motions under_load(scene, [&] { return l_cloud(d); });
  scene.bodies[0].loads.clear();
  const Motions free(scene, [&] { return l_cloud(d); });
  const auto start = Clock::now();
  const Changes usual = free_motion(under_load, free, scene, free.dt, 100'000),
                halved = free_motion(under_load, free, scene, free.dt / 2, 200'000);
  return under_load.solution(start, usual.steps + halved.steps,
                             {{"momentum by impulse", usual.momentum / (norm(push) * pushed_for)},
                              {"change of angular momentum", usual.turned},
                              {"drift of energy", usual.drift},
                              {"drift of energy in halved steps", halved.drift}});
}

}  // namespace

std::vector<AccuracyCase> dynamic_cases() {
  return {
      {"bending",
       "The bar of *gravity*, clamped at one end and without weight, vibrates in its first bending "
       "mode. Reference: quadratic finite elements, graded towards the clamped edges; ± 0.002%.",
       {4, 6, 8},
       bending},
      {"torsion",
       "The same bar vibrates in its first torsional mode. Reference: the same elements; ± 0.005%.",
       {4, 6, 8},
       torsion},
      {"stretching",
       "The same bar vibrates in its first axial mode. Reference: the same elements; ± 0.001%.",
       {4, 6, 8},
       stretching},
      {"damping",
       "The bar of *stretching* with viscosity, whose relaxation time τ damps the first mode by 2% "
       "of critical damping, ξ = τ ω/2: the logarithmic decrement of the vibration. Reference: 2 π "
       "ξ/√(1 - ξ²) of a Kelvin-Voigt solid.",
       {4, 6, 8},
       damped},
      {"spinning",
       "A free block, 3 : 2 : 1, tumbles about its middle axis for a million steps of 0.8 of the "
       "stability limit, at strains of a percent: momenta and energy should be conserved. The "
       "energies compared are means of a hundred samples at the beginning and at the end.",
       {4},
       spinning},
      {"L-block",
       "A free L-shaped block is pushed at its two ends in opposite directions for five seconds, "
       "then tumbles for 100,000 steps with large bending (Simo and Tarnow 1992): momenta and "
       "energy should be conserved. Energy is sampled as in *spinning*. Part of it goes into fast "
       "waves, whose energy has a larger error at longer steps; so the same time is also run with "
       "steps of half the length.",
       {4},
       l_block},
  };
}

std::vector<AccuracyCase> accuracy_cases() {
  std::vector<AccuracyCase> all;
  for (const auto& cases : {static_cases(), dynamic_cases(), plastic_cases(), collapse_cases(),
                            impact_cases(), contact_cases(), fracture_cases()}) {
    all.insert(all.end(), cases.begin(), cases.end());
  }
  return all;
}

}  // namespace phyxel::app
