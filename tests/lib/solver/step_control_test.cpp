/// Steps are halved where laws stiffen.
#include "phyxel/step_control.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
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
  StepControl control(model, backend, plan);
  while (solver.steps() < plan.steps) {
    if (kept && solver.steps() % (plan.lengthens ? 397 : 97) == 0) kept->push_back(solver.state());
    if (shorten) {
      const int made = control.look(solver, plan.halvings);
      plan.halve(made);
      if (kept && made != 0) kept->push_back(solver.state());
    }
    solver.step();
    if (watch && solver.steps() % 50 == 0) {
      watch->check(diagnose(model, backend, solver.now()), &control);
    }
  }
  return solver.state();
}

/// What a new user met: the default safety, a neo-Hookean body, and a stretch.
TEST(StepControl, KeepsABodyStableThatOutgrowsItsStep) {
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
TEST(StepControl, LooksAtSmallBodiesInTime) {
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
TEST(StepControl, KeepsTheStepThatOnlyOnePlaceOutgrows) {
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
  StepControl control(model, *backend, plan);
  double stiffest = 1;
  StabilityWatch watch(model, first);
  while (solver.steps() < plan.steps) {
    plan.halve(control.look(solver, plan.halvings));
    if (solver.steps() % 50 == 0) {
      stiffest = std::max(stiffest, find_stiffening(model, *backend).ratio);
      watch.check(diagnose(model, *backend, solver.now()), &control);
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
TEST(StepControl, LooksSeldomAtABodyThatKeepsItsShape) {
  Scene scene = spun_scene();
  scene.bodies[0].spin = {0, 0, 0.1};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const StepPlan plan = plan_of(model);
  Solver solver(model, *backend, initial_state(model, scene, plan.dt), Method::verlet);
  StepControl control(model, *backend, plan);
  int looks = 0;
  for (std::int64_t last = -1; solver.steps() < plan.steps; solver.step()) {
    EXPECT_EQ(control.look(solver, 0), 0);
    if (solver.looks().last != last) ++looks, last = solver.looks().last;
  }
  // The first, then after 1, 2, 4, 8, 16 and 32 steps, and after as many each.
  EXPECT_EQ(control.fewest(), 1);
  EXPECT_EQ(looks, 1 + 5 + (plan.steps - 1 - 31) / control.most());
}

/// A body that stiffened fast a while ago is looked at soon, though it is calm now; half of that is
/// forgotten in 64 steps.
TEST(StepControl, RemembersHowFastABodyStiffened) {
  Scene scene = spun_scene();
  scene.bodies[0].spin = {0, 0, 0.1};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const StepPlan plan = plan_of(model);
  Solver solver(model, *backend, initial_state(model, scene, plan.dt), Method::verlet);
  StepControl control(model, *backend, plan);
  const auto step = [&](int steps) {
    for (int s = 0; s < steps; ++s, solver.step()) control.look(solver, 0);
  };
  const auto interval = [&] { return solver.looks().next - solver.looks().last; };
  step(500);
  ASSERT_EQ(interval(), control.most());
  solver.looks().change = 0.05;
  step(static_cast<int>(solver.looks().next - solver.steps()) + 1);
  // 0.05 has faded over 32 steps to 0.035; half the way to a stiffening of 1/(1.1 0.8²) takes
  // 5.9 steps, cut to whole ones.
  EXPECT_EQ(interval(), 5);
  step(1000);
  EXPECT_EQ(interval(), control.most());
}

/// A bar of rubber with a weight at its end, let go: it stretches by half and comes back, again
/// and again.
Scene bouncing_scene(Precision precision = Precision::double_) {
  Material material = rubber();
  material.law = "st-venant-kirchhoff";
  material.young = 2e4;
  material.poisson = 0;  // else a stretched bar is narrower, and softer across
  material.hourglass = 0.1;
  Scene scene = one_body(material);
  scene.solver.precision = precision;
  scene.gravity = {0, 0, -0.06};
  material.density *= 1600;
  scene.bodies[0].inclusions.push_back(
      {.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.08}}}, .material = material});
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, 0.75}, {1, 1, 1}}}});
  return scene;
}
Model bouncing_model() { return model_of(bouncing_scene(), lattice(3, 3, 12, 0.2 / 3)); }

/// What a run has taken, and where it ended.
struct Taken {
  std::int64_t steps = 0, halvings = 0, doublings = 0;
  double drift = 0;  ///< Largest error of the total energy, by the largest elastic one.
  Vec3d end;         ///< Mean displacement [m].
};
/// 48 seconds of the bouncing bar: four times up and down.
Taken bounce(const Model& model, double safety, bool shortens, bool lengthens) {
  const auto backend = make_test_backend(model, Precision::double_, 1);
  StepPlan plan = plan_of(model, safety);
  plan.dt = 48 / std::ceil(48 / plan.dt);  // all end at the same time
  plan.steps = std::llround(48 / plan.dt);
  plan.shortens = shortens;
  plan.lengthens = lengthens;
  Solver solver(model, *backend, initial_state(model, bouncing_scene(), plan.dt), Method::verlet);
  StepControl control(model, *backend, plan);
  const Diagnostics first = diagnose(model, *backend, solver.now());
  Taken taken;
  double exchanged = 0;
  for (; solver.steps() < plan.steps; ++taken.steps) {
    const int made = control.look(solver, plan.halvings);
    plan.halve(made);
    taken.halvings += std::max(0, made);
    solver.step();
    if (solver.steps() % 20 != 0) continue;
    const Diagnostics now = diagnose(model, *backend, solver.now());
    exchanged = std::max(exchanged, now.elastic_energy());
    taken.drift = std::max(taken.drift, std::abs(now.total_energy() - first.total_energy()));
  }
  EXPECT_NEAR(solver.time(), 48, 1e-9);
  taken.drift /= exchanged;
  taken.doublings = solver.looks().doublings;
  for (const Vec3d& u : solver.state().displacement) taken.end += (1.0 / model.size()) * u;
  return taken;
}

/// Steps are doubled again where a body has come back: of the steps that halving for good costs,
/// half are saved, for the same answer and the same energy.
TEST(StepControl, LengthensTheStepOfABodyThatComesBack) {
  const Model model = bouncing_model();
  const Taken adaptive = bounce(model, 0.8, true, true), halved = bounce(model, 0.8, true, false),
              fixed = bounce(model, 0.4, false, false), fine = bounce(model, 0.1, false, false);
  EXPECT_EQ(halved.halvings, 1);
  EXPECT_EQ(halved.doublings, 0);
  EXPECT_EQ(adaptive.halvings, 5);
  EXPECT_EQ(adaptive.doublings, 5);
  const auto saved = static_cast<double>(fixed.steps - adaptive.steps);
  EXPECT_GT(saved, 0.4 * static_cast<double>(fixed.steps) / 2);  // seen 0.53
  // Of the order of the longer steps: four times what those of half their size are off by.
  const double error = norm(adaptive.end - fine.end), error_of_half = norm(fixed.end - fine.end);
  EXPECT_LT(error, 4 * error_of_half);
  EXPECT_LT(adaptive.drift, 1.5 * halved.drift);  // seen 1.1
  EXPECT_LT(adaptive.drift, 1e-5);
}

/// A look may come after an odd number of steps, as in bodies so small that one step is enough
/// between two looks; the step is doubled after the next one.
TEST(StepControl, LengthensAfterAnEvenNumberOfSteps) {
  const Model model = model_of(bouncing_scene(), lattice(2, 2, 8, 0.1));
  const auto backend = make_test_backend(model, Precision::double_, 1);
  StepPlan plan = plan_of(model);
  plan.lengthens = true;
  Solver solver(model, *backend, initial_state(model, bouncing_scene(), plan.dt), Method::verlet);
  StepControl control(model, *backend, plan);
  ASSERT_EQ(control.fewest(), 1);
  solver.halve_step();
  plan.halve(1);
  solver.looks().next = 7;
  while (solver.steps() < 7) solver.step();
  EXPECT_EQ(control.look(solver, plan.halvings), 0);
  EXPECT_EQ(solver.looks().next, 8);
  solver.step();
  plan.halve(control.look(solver, plan.halvings));
  EXPECT_EQ(plan.halvings, 0);
  EXPECT_EQ(solver.looks().doublings, 1);
}

/// A cube falls onto its foot faster than half the speed of its waves: within two steps its lowest
/// phyxels are so stiff that looks a few steps apart would come too late.
TEST(StepControl, LooksAtEachStepOfAShock) {
  Material material = rubber();
  material.law = "hencky";
  material.young = 3e4;
  material.hourglass = 0.1;
  Scene scene = one_body(material);
  scene.bodies[0].velocity = {0, 0, -5};
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.03}}}});
  const Model model = model_of(scene, lattice(9, 9, 9, 0.05));
  const auto backend = make_test_backend(model, Precision::double_, 2);
  StepPlan plan = plan_of(model);
  plan.steps = 60;
  const State start = initial_state(model, scene, plan.dt);
  backend->upload(start);
  StabilityWatch watch(model, diagnose(model, *backend, 0, plan.dt));
  const State end = run(model, *backend, plan, start, true, nullptr, &watch);
  EXPECT_GE(plan.halvings, 2);
  EXPECT_EQ(diagnose(model, *backend, end.step, end.dt).inverted, 0);
}

/// A step that a scene gives is halved where it must be, and stays so.
TEST(StepControl, KeepsStepsThatASceneGivesFromGrowing) {
  Scene scene = bouncing_scene();
  const Model model = bouncing_model();
  const auto backend = make_test_backend(model, Precision::double_, 1);
  EXPECT_TRUE(plan_steps(scene, model, *backend).lengthens);
  EXPECT_FALSE(plan_steps(scene, model, *backend, true).lengthens);
  scene.time.step = 0.5 * step_limit(model, 1).largest_step;
  const StepPlan given = plan_steps(scene, model, *backend);
  EXPECT_TRUE(given.shortens);
  EXPECT_FALSE(given.lengthens);
}

/// A plan goes back as far as it was halved, and no further.
TEST(StepControl, PlansGoBackToThePlannedStep) {
  StepPlan plan;
  plan.dt = 0.01, plan.steps = 300, plan.steps_per_frame = 100;
  plan.halve(3);
  EXPECT_EQ(plan.steps, 2400);
  EXPECT_EQ(plan.dt, 0.01 / 8);
  plan.halve(-1);
  EXPECT_EQ(plan.halvings, 2);
  EXPECT_EQ(plan.steps_per_frame, 400);
  plan.halve(-5);
  EXPECT_EQ(plan.halvings, 0);
  EXPECT_EQ(plan.dt, 0.01);
  EXPECT_EQ(plan.steps, 300);
}

/// From any state on the way, also from those just before and after a change of the step, and on
/// any number of threads, the same bits come.
void expect_same_after_restarts(const Model& model, const Scene& scene, const StepPlan& planned,
                                std::int64_t doublings) {
  StepPlan plan = planned;
  std::vector<State> kept;
  const Precision precision = scene.solver.precision;
  const auto whole = make_test_backend(model, precision, 2);
  const State end = run(model, *whole, plan, initial_state(model, scene, plan.dt), true, &kept);
  ASSERT_GE(plan.halvings + end.looks.doublings, 1);
  EXPECT_EQ(end.looks.doublings, doublings);
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

TEST(StepControl, GoesOnToTheBitAfterARestart) {
  const Model model = spun_model();
  for (const Precision precision : {Precision::double_, Precision::single, Precision::mixed}) {
    StepPlan plan = plan_of(model);
    plan.steps = 400;
    expect_same_after_restarts(model, spun_scene(precision), plan, 0);
  }
}

/// The same where a body comes back: once up and down, and up again.
TEST(StepControl, GoesOnToTheBitAfterARestartAmongStepsThatChange) {
  const Model model = bouncing_model();
  for (const Precision precision : {Precision::double_, Precision::single}) {
    StepPlan plan = plan_of(model);
    plan.lengthens = true;
    plan.steps = 1000;
    expect_same_after_restarts(model, bouncing_scene(precision), plan, 1);
  }
}

/// One phyxel a hundred kilometres off, or nowhere: no step is short enough, and the phyxel where
/// that began is named, by its global id, its place at rest, its stretch and the time.
TEST(StepControl, NamesWhereItBeganWhenNoStepIsShortEnough) {
  const Scene scene = spun_scene();
  const Model model = spun_model();
  const auto backend = make_test_backend(model, Precision::double_, 1);
  const StepPlan plan = plan_of(model);
  constexpr Index pulled = 77;
  const auto said_of = [&](double far, bool looked_before) {
    StepControl control(model, *backend, plan);
    State state = initial_state(model, scene, plan.dt);
    state.displacement[100] = {0.02, 0, 0};  // some stretch, before
    Solver solver(model, *backend, state, Method::verlet);
    if (looked_before) control.see(solver);
    state.displacement[pulled] = {far, 0, 0};
    backend->put(state);
    try {
      control.look(solver, 0);
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
TEST(StepControl, LeavesLinearMaterialsAlone) {
  Scene scene = one_body();
  scene.bodies[0].material.law = "small-strain";
  const Model linear = model_of(scene, lattice(3, 3, 3, 0.1));
  scene.bodies[0].material.volume_stiffness = 1e5;
  const Model stiffening_one = model_of(scene, lattice(3, 3, 3, 0.1));
  const StepPlan plan = plan_of(linear);
  const auto a = make_test_backend(linear, Precision::double_, 1),
             b = make_test_backend(stiffening_one, Precision::double_, 1);
  EXPECT_FALSE(StepControl(linear, *a, plan).active());
  EXPECT_TRUE(StepControl(stiffening_one, *b, plan).active());
  StepPlan unsafe = plan;
  unsafe.shortens = false;
  EXPECT_FALSE(StepControl(stiffening_one, *b, unsafe).active());
}

}  // namespace
}  // namespace phyxel
