/// Bodies that break: what a crack takes, what breaking keeps, and what whole bodies pay.
#include "model/fracture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/fracture.hpp"
#include "support/folder.hpp"
#include "support/strip.hpp"
#include "support/torn_bar.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

/// The energy that a strip loses while its crack grows by two spacings, over the exact value. Seen:
/// 0.982; finer strips come nearer (0.98, 0.987 at 16 and 24 across in plane strain).
TEST(Fracture, ACrackReleasesTheEnergyOfTheStripAhead) {
  Strip strip;
  strip.apart = 1e-3;
  const double exact = release_rate(strip);
  // The two inner layers of each grip do not stretch: within a layer of ψ times the height between.
  const double m =
      strip.young * (1 - strip.poisson) / ((1 + strip.poisson) * (1 - 2 * strip.poisson));
  EXPECT_NEAR(exact, 0.5 * m * strip.apart * strip.apart * (strip.height - 2),
              exact / strip.height);
  strip.crack = 20;
  const double before = rest_of(strip).energy;
  strip.crack = 22;
  const double released = (before - rest_of(strip).energy) / (2 * strip.width);
  EXPECT_NEAR(released, exact, 0.03 * exact);
}

/// A strip at rest under G, whose material then may break.
struct BreakingStrip {
  /// @param ratio G over G_c. @param safety share of the largest stable step
  BreakingStrip(Strip of, double exact, const StripAtRest& rest, double ratio, double safety)
      : strip(of) {
    strip.energy_release_rate = exact / ratio;
    scene = strip.scene();
    model = strip.model(scene);
    backend = make_test_backend(model, Precision::double_);
    dt = safety * step_limit(model).largest_step;
    State state = initial_state(model, scene, dt);
    notch = state.broken.size();
    state.displacement = rest.displacement;
    state.step = 1;  // supports have arrived
    state.time = dt;
    solver = std::make_unique<Solver>(model, *backend, state, Method::verlet);
  }
  /// How far the crack has come [spacings].
  double tip() const {
    double tip = 0;
    for (const PhyxelPair& pair : solver->state().broken) {
      tip = std::max(tip, 0.5 * (model.position[pair[0]].x + model.position[pair[1]].x));
    }
    return tip;
  }
  Diagnostics now() { return diagnose(model, *backend, *solver); }

  Strip strip;
  Scene scene;
  Model model;
  std::unique_ptr<Backend> backend;
  std::unique_ptr<Solver> solver;
  double dt = 0;
  std::size_t notch = 0;  // pairs that are broken from the start
};

/// G_c is a middle of the loads under which cuts begin to grow, by where they end in the lattice:
/// 0.92 and 1.09 G_c with this support. Cracks that run go on below G_c, by the waves that they
/// make, so that one that starts runs through.
TEST(Fracture, ACrackRunsWhereTheStripOffersMoreThanItTakes) {
  Strip strip;
  strip.apart = 1e-3;
  const double exact = release_rate(strip);
  strip.crack = 20;
  const StripAtRest rest = rest_of(strip);
  BreakingStrip below(strip, exact, rest, 0.85, 0.8);
  below.solver->step(600);
  EXPECT_EQ(below.solver->state().broken.size(), below.notch);
  EXPECT_EQ(below.now().fracture_energy, 0);

  double error = 0;
  for (const double safety : {0.8, 0.4}) {
    BreakingStrip run(strip, exact, rest, 1.15, safety);
    const double start = run.now().total_energy();
    run.solver->step(static_cast<std::int64_t>(480 / safety));
    const Diagnostics now = run.now();
    EXPECT_GT(run.tip(), strip.length - 2);
    // Breaking takes a part of G_c; the rest of G is in waves, as of a lattice that snaps. Seen:
    // 0.76.
    const double taken = now.fracture_energy / (strip.width * (strip.length - strip.crack) *
                                                *run.strip.energy_release_rate);
    EXPECT_GT(taken, 0.5);
    EXPECT_LT(taken, 1);
    // The total is off by the square of the step: seen 3.6% and 0.4% of the energy of the strip.
    // With energies at the end of steps it is off by 20%, in proportion to the step.
    const double off = std::abs(now.total_energy() / start - 1);
    EXPECT_LT(off, safety == 0.8 ? 0.05 : 0.4 * error);
    error = off;
  }
}

/// Energies before and after a break differ by what is counted, at displacements and velocities
/// that do not change. The rest is that of Verlet's method in double: seen 1e-4 of the energy at
/// the start.
TEST(Fracture, KeepsTotalEnergyAndMomenta) {
  TornBar bar;
  const Diagnostics start = bar.now();
  double worst = 0;
  for (int k = 0; k < 20; ++k) {
    bar.solver->step(50);
    worst = std::max(worst, std::abs(bar.now().total_energy() / start.total_energy() - 1));
  }
  const Diagnostics end = bar.now();
  EXPECT_GT(bar.solver->state().broken.size(), 500u);
  EXPECT_GT(end.fracture_energy, 0.005 * start.total_energy());
  EXPECT_LT(worst, 2e-3);
  // Forces act between pairs: momenta are kept to rounding.
  EXPECT_LT(norm(end.momentum - start.momentum), 1e-12 * norm(start.momentum));
  EXPECT_LT(norm(end.angular_momentum - start.angular_momentum),
            1e-6 * norm(start.angular_momentum));
}

TEST(Fracture, HasTheSameBitsOnAnyNumberOfThreads) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    TornBar one(precision, 1), two(precision, 2), three(precision, 3);
    for (TornBar* bar : {&one, &two, &three}) bar->solver->step(400);
    const State state = one.solver->state();
    EXPECT_GT(state.broken.size(), 100u);
    for (TornBar* bar : {&two, &three}) {
      const State other = bar->solver->state();
      EXPECT_EQ(state.broken, other.broken);
      EXPECT_EQ(state.worn, other.worn);
      EXPECT_EQ(state.displacement, other.displacement);
      EXPECT_EQ(state.velocity, other.velocity);
      EXPECT_EQ(state.step_sums, other.step_sums);
    }
  }
}

TEST(Fracture, ContinuesWithTheSameBits) {
  for (const Precision precision : {Precision::single, Precision::double_, Precision::mixed}) {
    TornBar whole(precision), first(precision), second(precision);
    whole.solver->step(400);
    first.solver->step(250);
    const State between = first.solver->state();
    EXPECT_GT(between.broken.size(), 50u);
    Solver continued(second.model, *second.backend, between, Method::verlet);
    EXPECT_EQ(continued.state().broken, between.broken);
    continued.step(150);
    const State expected = whole.solver->state(), found = continued.state();
    EXPECT_GT(expected.broken.size(), between.broken.size());
    EXPECT_EQ(found.broken, expected.broken);
    EXPECT_EQ(found.worn, expected.worn);
    EXPECT_EQ(found.displacement, expected.displacement);
    EXPECT_EQ(found.velocity, expected.velocity);
    EXPECT_EQ(found.step_sums, expected.step_sums);
    // A backend goes back, too.
    const State start = TornBar(precision).solver->state();
    Solver again(second.model, *second.backend, start, Method::verlet);
    again.step(400);
    EXPECT_EQ(again.state().displacement, expected.displacement);
  }
}

/// Pairs are looked at where they may have come near breaking: a run whose state is put in anew
/// before each step, so that all are looked at, breaks the same pairs at the same steps.
TEST(Fracture, LooksMissNoPair) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    TornBar whole(precision), anew(precision);
    State state = anew.solver->state();
    for (int s = 0; s < 300; ++s) {
      whole.solver->step(1);
      Solver next(anew.model, *anew.backend, state, Method::verlet);
      next.step(1);
      state = next.state();
      ASSERT_EQ(whole.solver->state().broken, state.broken) << s;
    }
    EXPECT_GT(state.broken.size(), 50u);
    EXPECT_EQ(whole.solver->state().displacement, state.displacement);
  }
}

using FractureFiles = test::Folder;

TEST_F(FractureFiles, CheckpointsHaveTheBrokenPairs) {
  TornBar bar(Precision::single);
  bar.solver->step(250);
  const State state = bar.solver->state();
  const CheckpointInfo info{.program = "test", .precision = Precision::single};
  const State read = read_checkpoint(write_checkpoint(folder_, state, info)).state;
  EXPECT_EQ(read.broken, state.broken);
  EXPECT_FALSE(state.worn.empty());
  EXPECT_EQ(read.worn, state.worn);
  EXPECT_EQ(read.step_sums, state.step_sums);
  State wrong = state;
  std::swap(wrong.broken.front(), wrong.broken.back());
  const auto file = write_checkpoint(folder_, wrong, info);
  EXPECT_THROW(read_checkpoint(file), InputError);
  wrong = state;
  wrong.worn.front().carried = 1;
  const auto whole = write_checkpoint(folder_, wrong, info);
  EXPECT_THROW(read_checkpoint(whole), InputError);
  wrong.worn.clear();
  wrong.broken = {{0, bar.model.size() - 1}};  // the two ends of the bar
  EXPECT_THROW(bar.backend->upload(wrong), InputError);
}

/// What is crushed along one axis and bursts along the others turns to dust, in which gradients of
/// few neighbours are large. Without `share_after_break` these make energy that breaks the rest:
/// seen -3.4 times the energy at the start.
TEST(Fracture, DustMakesNoEnergy) {
  Scene scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000, .hourglass = 0.1});
  scene.bodies[0].fracture = FractureRequest{.energy_release_rate = 2};
  scene.bodies[0].fracture->where = "test";
  const Model model = model_of(scene, lattice(12, 12, 6, 0.05));
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto backend = make_test_backend(model, Precision::double_);
  State state = initial_state(model, scene, dt);
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d from = model.position[i] - model.parts[0].centre;
    state.velocity[i] = {-40 * from.x, 15 * from.y, 15 * from.z};
  }
  Solver solver(model, *backend, state, Method::verlet);
  const Diagnostics start = diagnose(model, *backend, solver);
  double taken = 0;
  for (int k = 0; k < 200; ++k) {
    solver.step(5);
    const Diagnostics now = diagnose(model, *backend, solver);
    EXPECT_GE(now.fracture_energy, taken);
    taken = now.fracture_energy;
    EXPECT_NEAR(now.total_energy(), start.total_energy(), 0.02 * start.total_energy());
  }
  const State end = solver.state();
  EXPECT_GT(end.broken.size(), 0.5 * 0.5 * static_cast<double>(model.pairs()));
  EXPECT_FALSE(end.worn.empty());
}

/// The force of a closed pair is the slope of its energy, of which each phyxel has a half; it ends
/// where the two touch no more. Central differences of a quadratic function are exact but for
/// rounding.
TEST(Fracture, ForcesOfClosedPairsFollowFromTheirEnergy) {
  const ClosedPair pair{.stiffness = 7, .rest = 0.5};
  const Vec3d x{0.4, 0.2, -0.1}, u{-0.15, 0.05, 0.12};
  constexpr double step = 1e-5;
  const Vec3d force = pair.force(x, u);
  EXPECT_GT(norm(force), 0.1);
  for (int c = 0; c < 3; ++c) {
    Vec3d by;
    (c == 0 ? by.x : c == 1 ? by.y : by.z) = step;
    // The phyxel moves the other way than the difference of displacements.
    const double slope = 2 * (pair.energy(x, u + by) - pair.energy(x, u - by)) / (2 * step);
    EXPECT_NEAR((c == 0 ? force.x : c == 1 ? force.y : force.z), slope, 1e-8);
  }
  EXPECT_EQ(pair.force(-1.0 * x, -1.0 * u), -1.0 * force);
  EXPECT_EQ(pair.force(x, x), Vec3d{});
  EXPECT_EQ(pair.energy(x, x), 0);
}

/// A bar that is cut through bears pressure, and no tension. Its cut is softer than its inside, as
/// any face is without closed gradients: seen 0.74 of the whole bar's force with 12 phyxels along
/// it.
TEST(Fracture, ClosedCracksBearPressure) {
  const auto force_of = [](bool cut, double strain) {
    Scene scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000, .hourglass = 0.1});
    scene.solver.method = Method::equilibrium;
    BodyRequest& body = scene.bodies[0];
    const double length = 0.6, edge = 0.026;
    body.fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {edge, 1, 1}}}});
    body.motions.push_back({.select = {.box = Selection::Box{{length - edge, -1, -1}, {1, 1, 1}}},
                            .displacement = {strain * length, 0, 0},
                            .duration = 1e-12});
    if (cut) {
      body.notches.push_back({.centre = {0.5 * length, 0, 0}, .normal = {1, 0, 0}, .radius = 1});
    }
    const Model model = model_of(scene, lattice(12, 4, 4, 0.05));
    const auto backend = make_test_backend(model, Precision::double_);
    Solver solver(model, *backend, initial_state(model, scene, 1), Method::equilibrium);
    solver.step(1);
    std::vector<Vec3d> force;
    backend->internal_forces(force);
    double sum = 0;
    for (Index i = 0; i < model.size(); ++i) sum += model.position[i].x < edge ? force[i].x : 0;
    return sum;
  };
  const double pressed = force_of(false, -0.01), cut = force_of(true, -0.01);
  EXPECT_LT(pressed, -0.8 * 0.01 * 1e6 * 0.2 * 0.2);

  EXPECT_LT(cut, 0.65 * pressed);
  EXPECT_GT(cut, pressed);
  EXPECT_LT(std::abs(force_of(true, 0.01)), 1e-6 * std::abs(pressed));
}

/// A phyxel without neighbours has no force but that of others that it touches: it flies on.
TEST(Fracture, DebrisFliesFreely) {
  TornBar bar;
  bar.solver->step(1000);
  const Breakage breakage = bar.backend->breakage().value();
  std::vector<Vec3d> force;
  bar.backend->internal_forces(force);
  int free = 0, weak = 0;
  for (Index i = 0; i < bar.model.size(); ++i) {
    EXPECT_GE(breakage.broken[i], 0);
    EXPECT_LE(breakage.carried[i], 1);
    weak += breakage.carried[i] < 1;
    if (breakage.broken[i] < 1) continue;
    ++free;
    EXPECT_EQ(breakage.carried[i], 0);
    EXPECT_EQ(force[i] == Vec3d{}, breakage.closed[i] == 0);
  }
  EXPECT_GT(free + weak, 0);
}

/// No array, and the same bits, in a scene that asks for no fracture; and in one that does, nothing
/// changes before a pair breaks.
TEST(Fracture, CostsNothingWhereNothingBreaks) {
  const auto memory_of = [](const Backend& backend) {
    std::size_t bytes = 0;
    for (const ArrayBytes& array : backend.memory()) bytes += array.bytes;
    return bytes;
  };
  Scene scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000, .hourglass = 0.1});
  scene.bodies[0].spin = {0, 0, 5};
  const Model plain = model_of(scene, lattice(8, 5, 5, 0.05));
  scene.bodies[0].fracture = FractureRequest{.energy_release_rate = 1e9};
  const Model tough = model_of(scene, lattice(8, 5, 5, 0.05));
  EXPECT_TRUE(plain.fracture.growth.empty());
  const double dt = 0.5 * step_limit(plain).largest_step;
  const auto a = make_test_backend(plain, Precision::single),
             b = make_test_backend(tough, Precision::single);
  Solver one(plain, *a, initial_state(plain, scene, dt), Method::verlet);
  Solver other(tough, *b, initial_state(tough, scene, dt), Method::verlet);
  for (const ArrayBytes& array : a->memory()) EXPECT_NE(array.name, "fracture");
  EXPECT_TRUE(one.step_sums().empty());
  EXPECT_FALSE(a->breakage().has_value());
#if !defined(PHYXEL_TEST_CUDA)  // a GPU has a second copy of its lists
  // Displacements at both ends of a step and the index of the phyxel of each slot, of which there
  // are as many as phyxels and a pack more, and two numbers of each pack of four lanes or more.
  const std::size_t slots = static_cast<std::size_t>(plain.size()) + 16;
  EXPECT_LE(memory_of(*b), memory_of(*a) + slots * (6 * 4 + 4) + slots / 4 * (8 + 4));
#endif
  one.step(300);
  other.step(300);
  EXPECT_EQ(one.state().displacement, other.state().displacement);
  EXPECT_TRUE(other.state().broken.empty());
}

TEST_F(FractureFiles, NotchesAndUnbreakableRegionsActWhereTheyAre) {
  Scene scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000, .hourglass = 0.1});
  BodyRequest& body = scene.bodies[0];
  // Between the layers at 0.175 and 0.225 m, up to x = 0.195 m.
  body.notches.push_back({.centre = {-10, 0.2, 0.1}, .normal = {0, 2, 0}, .radius = 10.195});
  const Model model = model_of(scene, lattice(8, 8, 4, 0.05));
  const std::vector<PhyxelPair> pairs = notched_pairs(model, scene);
  ASSERT_FALSE(pairs.empty());
  for (const PhyxelPair& pair : pairs) {
    const Vec3d a = model.position[pair[0]], b = model.position[pair[1]];
    EXPECT_LT((a.y - 0.2) * (b.y - 0.2), 0);
    const double share = (0.2 - a.y) / (b.y - a.y);
    EXPECT_LT(a.x + share * (b.x - a.x), 0.2 + 1e-6);
  }
  // The same by a square of two triangles, which ends at the same x.
  body.notches[0] = {.mesh = write("cut.obj",
                                   "v -1 0.2 -1\nv 0.195 0.2 -1\nv 0.195 0.2 1\nv -1 0.2 1\n"
                                   "f 1 2 3\nf 1 3 4\n")};
  EXPECT_EQ(notched_pairs(model, scene), pairs);
  body.notches[0] = {.centre = {-20, 0.2, 0.1}, .normal = {0, 1, 0}, .radius = 10};
  EXPECT_THROW(notched_pairs(model, scene), InputError);
  body.notches.clear();

  body.fracture = FractureRequest{.energy_release_rate = 5};
  body.fracture->unbreakable.push_back({.box = Selection::Box{{-1, -1, -1}, {0.1, 1, 1}}});
  const Model kept = model_of(scene, lattice(8, 8, 4, 0.05));
  EXPECT_NO_THROW(check_unbreakable(kept, scene));
  for (Index i = 0; i < kept.size(); ++i) {
    EXPECT_EQ(kept.fracture.growth[i] < 0, kept.position[i].x < 0.1);
  }
  body.fracture->unbreakable[0].box = Selection::Box{{2, 2, 2}, {3, 3, 3}};
  EXPECT_THROW(check_unbreakable(kept, scene), InputError);
}

/// The distribution of the critical stretches of pairs, of which the weaker phyxel decides: the
/// share below f s_c is 1 - exp(-f^m). Five standard deviations of the share of some 12,000 pairs,
/// which are not independent, are 0.03.
TEST(Fracture, ScatterIsWeibulls) {
  Scene scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000, .hourglass = 0.1});
  scene.bodies[0].fracture = FractureRequest{.energy_release_rate = 5, .scatter = 6, .seed = 2};
  const Model model = model_of(scene, lattice(10, 10, 10, 0.05));
  const double s_c = critical_stretch(5, 1e6, 0.25, 0.05, 1.8 * (6 + 4 * std::sqrt(2.0)) / 10);
  for (const double f : {0.7, 0.9, 1.1}) {
    double below = 0, all = 0;
    for (Index i = 0; i < model.size(); ++i) {
      for (const Index j : model.neighbourhood.neighbours.row(i)) {
        ++all;
        below +=
            std::min(model.fracture.growth[i], model.fracture.growth[j]) < f * s_c * (2 + f * s_c);
      }
    }
    EXPECT_NEAR(below / all, 1 - std::exp(-std::pow(f, 6)), 0.05);
  }
  scene.bodies[0].fracture->seed = 3;
  EXPECT_NE(model_of(scene, lattice(10, 10, 10, 0.05)).fracture.growth, model.fracture.growth);
}

TEST(Fracture, ImplicitStepsBreakAtTheirEnds) {
  Strip strip;
  strip.length = 12;
  strip.height = 8;
  strip.width = 3;
  strip.apart = 0.05;
  strip.energy_release_rate = 1e-3 * strip.young * 0.05;
  Scene scene = strip.scene(Method::implicit);
  scene.time.step = 0.02;
  const Model model = strip.model(scene);
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(model, *backend, initial_state(model, scene, 0.02), Method::implicit);
  solver.step(3);
  EXPECT_FALSE(solver.state().broken.empty());
  EXPECT_GT(diagnose(model, *backend, solver).fracture_energy, 0);
}

/// What is refused, each by its key and value, with what is allowed.
TEST(Fracture, IsRefusedWhereItCannotBe) {
  const auto refusal = [](auto&& change) {
    Scene scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000, .hourglass = 0.1});
    scene.bodies[0].fracture = FractureRequest{.energy_release_rate = 5};
    change(scene, scene.bodies[0]);
    try {
      model_of(scene, lattice(6, 5, 5, 0.05));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  using Body = BodyRequest;
  EXPECT_EQ(refusal([](Scene&, Body&) {}), "accepted");
  EXPECT_THAT(refusal([](Scene&, Body& b) { b.fracture->energy_release_rate = 0; }),
              HasSubstr("energy_release_rate"));
  EXPECT_THAT(refusal([](Scene&, Body& b) { b.material.poisson = 0.45; }), HasSubstr("0 to 0.35"));
  EXPECT_THAT(refusal([](Scene&, Body& b) { b.neighbourhood.factor = 3; }),
              HasSubstr("body.neighbours.factor = 3; allowed: 1.54 to 1.89"));
  EXPECT_THAT(refusal([](Scene&, Body& b) { b.material.hourglass = 0; }),
              HasSubstr("body.material.hourglass = 0"));
  EXPECT_THAT(refusal([](Scene&, Body& b) { b.material.viscosity = 1e-3; }),
              HasSubstr("viscosity"));
  EXPECT_THAT(refusal([](Scene&, Body& b) { b.material.volume_stiffness = 10; }),
              HasSubstr("volume_stiffness = 10"));
  EXPECT_THAT(refusal([](Scene&, Body& b) {
                b.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
                b.material.hourglass = 0;
              }),
              HasSubstr("one-sided"));
  EXPECT_THAT(refusal([](Scene&, Body& b) {
                b.material.law = "j2";
                b.material.parameters = {{"yield_stress", 1e3}, {"hardening", 5e3}};
              }),
              HasSubstr("law = \"j2\""));
  EXPECT_THAT(refusal([](Scene& s, Body&) { s.solver.method = Method::equilibrium; }),
              HasSubstr("equilibrium"));
  EXPECT_THAT(refusal([](Scene& s, Body&) { s.contact = ContactRequest{}; }),
              HasSubstr("[contact]"));
  // s_c E' is 1.5e4 Pa here, and that of phyxels 225 times as far apart 1e3 Pa.
  EXPECT_THAT(refusal([](Scene&, Body& b) { b.fracture->strength = 1e3; }),
              HasSubstr("m apart cannot resolve"));
  EXPECT_EQ(refusal([](Scene&, Body& b) { b.fracture->strength = 1e5; }), "accepted");
}

}  // namespace
}  // namespace phyxel
