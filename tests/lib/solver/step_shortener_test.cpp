/// Steps are halved where laws stiffen.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

/// A neo-Hookean cube that flies apart: spun so fast that it stretches by half.
Scene spun_scene(Precision precision = Precision::double_) {
  Material material = rubber();
  material.law = "neo-hookean";
  material.young = 2e4;
  Scene scene = one_body(material);
  scene.solver.precision = precision;
  scene.bodies[0].spin = {0, 0, 14};
  return scene;
}
Model spun_model() { return model_of(spun_scene(), lattice(6, 6, 6, 0.1, 0.2)); }

StepPlan plan_of(const Model& model, double safety = 0.8) {
  StepPlan plan;
  plan.limit = step_limit(model, 1);
  plan.dt = safety * plan.limit.largest_step;
  plan.steps = plan.steps_per_frame = 1500;
  plan.shortens = true;
  return plan;
}

/// Steps to the end of the plan. @returns the final state, or that after a NaN
State run(const Model& model, Backend& backend, StepPlan& plan, State start, bool shorten,
          std::vector<State>* kept = nullptr, StabilityWatch* watch = nullptr) {
  Solver solver(model, backend, start, Method::verlet);
  StepShortener shortener(model, backend, plan);
  while (solver.steps() < plan.steps) {
    if (kept && solver.steps() % 97 == 0) kept->push_back(solver.state());
    if (shorten) {
      const int made = shortener.look(solver, plan.halvings);
      plan.halve(made);
      if (kept && made > 0) kept->push_back(solver.state());
    }
    solver.step();
    if (watch && solver.steps() % 50 == 0) {
      watch->check(diagnose(model, backend, solver.now()), &shortener);
    }
  }
  return solver.state();
}

/// What a new user met: the default safety, a neo-Hookean body, and a stretch.
TEST(StepShortener, KeepsABodyStableThatOutgrowsItsStep) {
  const Model model = spun_model();
  for (const Precision precision : {Precision::double_, Precision::single}) {
    const Scene scene = spun_scene(precision);
    const auto backend = make_test_backend(model, precision, 1);
    StepPlan plan = plan_of(model);
    const State start = initial_state(model, scene, plan.dt);
    backend->upload(start);
    const Diagnostics first = diagnose(model, *backend, 0, plan.dt);
    {
      StabilityWatch watch(model, first);
      StepPlan fixed = plan;
      EXPECT_THROW(run(model, *backend, fixed, start, false, nullptr, &watch), DivergedError);
    }
    StabilityWatch watch(model, first);
    const double end = plan.dt * static_cast<double>(plan.steps);
    const State last = run(model, *backend, plan, start, true, nullptr, &watch);
    EXPECT_GE(plan.halvings, 1);
    EXPECT_LE(plan.halvings, 2);
    EXPECT_EQ(last.time, end);  // to the bit: halves are exact
    const Diagnostics now = diagnose(model, *backend, last.step, last.dt);
    // Verlet's error is of the order (ω Δt)² of what moves, here fast modes near the limit: seen
    // 2%.
    EXPECT_NEAR(now.total_energy() / first.total_energy(), 1, 0.1);
  }
}

/// A small body flies apart in fewer steps than a large one takes between two looks.
TEST(StepShortener, LooksAtSmallBodiesInTime) {
  Scene scene = spun_scene();
  scene.bodies[0].spin = {0, 26, 20};
  for (const int across : {2, 3}) {
    const Model model = model_of(scene, lattice(3 * across, across, across, 0.2 / across, 0.2));
    const auto backend = make_test_backend(model, Precision::double_, 1);
    StepPlan plan = plan_of(model);
    plan.steps = 400;
    const State start = initial_state(model, scene, plan.dt);
    backend->upload(start);
    const Diagnostics first = diagnose(model, *backend, 0, plan.dt);
    StabilityWatch watch(model, first);
    const State last = run(model, *backend, plan, start, true, nullptr, &watch);
    EXPECT_GE(plan.halvings, 1);
    const Diagnostics now = diagnose(model, *backend, last.step, last.dt);
    // As above.
    EXPECT_NEAR(now.total_energy() / first.total_energy(), 1, 0.1) << across;
  }
}

/// The stiffest phyxel of an irregular body is seldom where its fastest mode is. A body that hangs
/// and stretches at one end keeps its step, though the bound of that end alone would not allow it.
TEST(StepShortener, KeepsTheStepThatOnlyOnePlaceOutgrows) {
  Material material = rubber();
  material.young = 2e4;
  Scene scene = one_body(material);
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, 1.15}, {1, 1, 2}}}});
  // Two phyxels at the lower end, which nothing stretches, are as near each other as a quarter of
  // the spacing: there the fastest mode is.
  Cloud cloud = lattice(3, 3, 13, 0.1);
  Vec3d lowest = cloud.position[0];
  for (const Vec3d& x : cloud.position) lowest = x.z < lowest.z ? x : lowest;
  cloud.position.push_back(lowest + Vec3d{0.015, 0.012, 0.01});
  cloud.volume.clear();
  const Model model = model_of(scene, cloud);
  const auto backend = make_test_backend(model, Precision::double_, 2);
  StepPlan plan = plan_of(model);
  const State start = initial_state(model, scene, plan.dt);
  Solver solver(model, *backend, start, Method::verlet);
  const Diagnostics first = diagnose(model, *backend, solver.now());
  StepShortener shortener(model, *backend, plan);
  double stiffest = 1;
  StabilityWatch watch(model, first);
  while (solver.steps() < plan.steps) {
    plan.halve(shortener.look(solver, plan.halvings));
    if (solver.steps() % 50 == 0) {
      stiffest = std::max(stiffest, find_stiffening(model, *backend).ratio);
      watch.check(diagnose(model, *backend, solver.now()), &shortener);
    }
    solver.step();
  }
  const double share = plan.dt / plan.limit.largest_step;
  EXPECT_GT(share * share * stiffest, 1.2);  // where steps would be halved by the bound alone
  EXPECT_EQ(plan.halvings, 0);
  const Diagnostics now = diagnose(model, *backend, solver.now());
  const double exchanged = std::abs(now.gravity_energy);
  EXPECT_NEAR(now.total_energy(), first.total_energy(), 0.02 * exchanged);
}

/// Where nothing changes, looks come ever more seldom.
TEST(StepShortener, LooksSeldomAtABodyThatKeepsItsShape) {
  Scene scene = spun_scene();
  scene.bodies[0].spin = {0, 0, 0.1};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const StepPlan plan = plan_of(model);
  Solver solver(model, *backend, initial_state(model, scene, plan.dt), Method::verlet);
  StepShortener shortener(model, *backend, plan);
  int looks = 0;
  for (std::int64_t last = -1; solver.steps() < plan.steps; solver.step()) {
    EXPECT_EQ(shortener.look(solver, 0), 0);
    if (solver.looks().last != last) ++looks, last = solver.looks().last;
  }
  // The first, then after 1, 2, 4, 8, 16 and 32 steps, and after as many each.
  EXPECT_EQ(shortener.fewest(), 1);
  EXPECT_EQ(looks, 1 + 5 + (plan.steps - 1 - 31) / shortener.most());
}

/// A body that stiffened fast a while ago is looked at soon, though it is calm now; half of that is
/// forgotten in 64 steps.
TEST(StepShortener, RemembersHowFastABodyStiffened) {
  Scene scene = spun_scene();
  scene.bodies[0].spin = {0, 0, 0.1};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const StepPlan plan = plan_of(model);
  Solver solver(model, *backend, initial_state(model, scene, plan.dt), Method::verlet);
  StepShortener shortener(model, *backend, plan);
  const auto step = [&](int steps) {
    for (int s = 0; s < steps; ++s, solver.step()) shortener.look(solver, 0);
  };
  const auto interval = [&] { return solver.looks().next - solver.looks().last; };
  step(500);
  ASSERT_EQ(interval(), shortener.most());
  solver.looks().change = 0.05;
  step(static_cast<int>(solver.looks().next - solver.steps()) + 1);
  // 0.05 has faded over 32 steps to 0.035; half the way to a stiffening of 1/(1.1 0.8²) takes
  // 5.9 steps, cut to whole ones.
  EXPECT_EQ(interval(), 5);
  step(1000);
  EXPECT_EQ(interval(), shortener.most());
}

/// Velocities move to t - dt/4 by the forces at t, by which those at t are found, too: energy at t
/// is what it was, and so are momenta.
TEST(StepShortener, HalvesAStepWithoutAJump) {
  Scene scene = spun_scene();
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force = {3, 1, 0}, .ramp = 10});
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}}},
                                   .axes = {.x = false, .y = true, .z = true}});
  const Model model = model_of(scene, lattice(6, 6, 6, 0.1, 0.2));
  const auto backend = make_test_backend(model, Precision::double_, 2);
  const double dt = 0.3 * step_limit(model, 1).largest_step;
  Solver solver(model, *backend, initial_state(model, scene, dt), Method::verlet);
  solver.step(200);
  const Diagnostics before = diagnose(model, *backend, solver.now());
  const double time = solver.time();
  solver.looks() = {
      .next = 210, .last = 190, .change = 0.5, .measured = 180, .measured_share = 0.8};
  solver.halve_step();
  const Looks halved{
      .next = 420, .last = 380, .change = 0.25, .measured = 360, .measured_share = 0.2};
  EXPECT_TRUE(solver.looks() == halved);
  const Diagnostics after = diagnose(model, *backend, solver.now());
  EXPECT_EQ(solver.time(), time);
  EXPECT_EQ(solver.steps(), 400);
  EXPECT_EQ(solver.dt(), dt / 2);
  EXPECT_EQ(after.elastic_energy(), before.elastic_energy());  // the same displacements
  // Two sums of the same terms: rounding.
  EXPECT_NEAR(after.kinetic_energy, before.kinetic_energy, 1e-12 * before.kinetic_energy);
  EXPECT_LT(norm(after.momentum - before.momentum), 1e-12 * before.force_scale * dt + 1e-9);
}

/// The trajectory beyond differs from that of whole steps as two step sizes do: by their square.
TEST(StepShortener, LosesNoOrderByHalving) {
  Scene scene = one_body();
  scene.bodies[0].spin = {0, 2, 1};
  const Model model = model_of(scene, lattice(4, 4, 4, 0.1, 0.2));
  const double dt = 0.4 * step_limit(model, 1).largest_step;
  const auto end_of = [&](double step, int steps, int halve_at) {
    const auto backend = make_test_backend(model, Precision::double_, 1);
    Solver solver(model, *backend, initial_state(model, scene, step), Method::verlet);
    for (std::int64_t last = steps; solver.steps() < last;) {
      if (solver.steps() == halve_at) solver.halve_step(), last *= 2, halve_at = -1;
      solver.step();
    }
    return solver.state().displacement;
  };
  const auto truth = end_of(dt / 32, 80 * 32, -1);
  const auto error = [&](const std::vector<Vec3d>& u) {
    double squares = 0;
    for (std::size_t i = 0; i < u.size(); ++i) squares += dot(u[i] - truth[i], u[i] - truth[i]);
    return std::sqrt(squares);
  };
  const double coarse = error(end_of(dt, 80, 40)), fine = error(end_of(dt / 2, 160, 80));
  EXPECT_GT(std::log2(coarse / fine), 1.7);
  EXPECT_LT(coarse, 1.5 * error(end_of(dt, 80, -1)));  // not worse than without
}

/// From any state on the way, also from those just before and after a step was halved, and on
/// any number of threads, the same bits come.
TEST(StepShortener, GoesOnToTheBitAfterARestart) {
  const Model model = spun_model();
  for (const Precision precision : {Precision::double_, Precision::single, Precision::mixed}) {
    const Scene scene = spun_scene(precision);
    StepPlan plan = plan_of(model);
    plan.steps = 400;
    const StepPlan planned = plan;
    std::vector<State> kept;
    const auto whole = make_test_backend(model, precision, 2);
    const State end = run(model, *whole, plan, initial_state(model, scene, plan.dt), true, &kept);
    ASSERT_GE(plan.halvings, 1);
    EXPECT_GT(end.looks.last, 0);
    for (const State& middle : kept) {
      StepPlan rest = planned;
      rest.halve(static_cast<int>(std::lround(std::log2(planned.dt / middle.dt))));
      ASSERT_EQ(rest.dt, middle.dt);
      const auto fresh = make_test_backend(model, precision, 1);
      const State again = run(model, *fresh, rest, middle, true);
      EXPECT_EQ(again.step, end.step);
      EXPECT_TRUE(again.looks == end.looks) << middle.step;
      EXPECT_TRUE(again.displacement == end.displacement) << middle.step;
      EXPECT_TRUE(again.velocity == end.velocity) << middle.step;
    }
  }
}

/// One phyxel a hundred kilometres off, or nowhere: no step is short enough, and the phyxel where
/// that began is named, by its global id, its place at rest, its stretch and the time.
TEST(StepShortener, NamesWhereItBeganWhenNoStepIsShortEnough) {
  const Scene scene = spun_scene();
  const Model model = spun_model();
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const StepPlan plan = plan_of(model);
  constexpr Index pulled = 77;
  const auto said_of = [&](double far, bool looked_before) {
    StepShortener shortener(model, *backend, plan);
    State state = initial_state(model, scene, plan.dt);
    state.displacement[100] = {0.02, 0, 0};  // some stretch, before
    Solver solver(model, *backend, state, Method::verlet);
    if (looked_before) shortener.see(solver);
    state.displacement[pulled] = {far, 0, 0};
    backend->upload(state);
    try {
      shortener.look(solver, 0);
    } catch (const DivergedError& error) {
      return std::string(error.what());
    }
    return std::string("stepped on");
  };
  const std::string far = said_of(1e5, false);
  const auto near = [&](const std::string& what, Index centre) {
    const auto at = what.find("it began at phyxel ");
    if (at == std::string::npos) return false;
    const Index named = std::stoi(what.substr(at + 19));
    EXPECT_THAT(what, HasSubstr(describe_phyxel(model, named) + ", stretched to "));
    return norm(model.position[named] - model.position[centre]) <=
           model.neighbourhood.support[centre];
  };
  EXPECT_TRUE(near(far, pulled)) << far;
  EXPECT_THAT(far, HasSubstr("1/1024 of those planned"));
  EXPECT_THAT(far, HasSubstr("at t = 0 s"));
  // Not a number anywhere: what was seen before is named, never the first of a list.
  const std::string lost = said_of(std::nan(""), true);
  EXPECT_THAT(lost, HasSubstr("the state is not finite"));
  EXPECT_TRUE(near(lost, 100)) << lost;
  EXPECT_THAT(said_of(std::nan(""), false), HasSubstr("nobody has looked at it before"));
}

/// Hooke's law in Cauchy's strain is linear: nothing is looked at, nothing is halved.
TEST(StepShortener, LeavesLinearMaterialsAlone) {
  Scene scene = one_body();
  scene.bodies[0].material.law = "small-strain";
  const Model linear = model_of(scene, lattice(3, 3, 3, 0.1));
  scene.bodies[0].material.volume_stiffness = 1e5;
  const Model stiffening_one = model_of(scene, lattice(3, 3, 3, 0.1));
  const StepPlan plan = plan_of(linear);
  const auto a = make_test_backend(linear, Precision::double_, 1),
             b = make_test_backend(stiffening_one, Precision::double_, 1);
  EXPECT_FALSE(StepShortener(linear, *a, plan).active());
  EXPECT_TRUE(StepShortener(stiffening_one, *b, plan).active());
  StepPlan unsafe = plan;
  unsafe.shortens = false;
  EXPECT_FALSE(StepShortener(stiffening_one, *b, unsafe).active());
}

}  // namespace
}  // namespace phyxel
