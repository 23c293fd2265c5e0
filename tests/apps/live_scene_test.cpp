/// Scenes that run while a user acts on them.
#include "view/live_scene.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {
namespace {

/// A free block of jelly of 0.2 m by 0.1 m by 0.1 m and 2 kg, in double.
LiveScene block(const std::string& head = {}, const std::string& more = {},
                const std::string& body = {}) {
  const std::string text = head +
                           "[time]\nend = 1\n[solver]\ndevice = 'cpu'\nprecision = 'double'\n"
                           "threads = 1\n[[body]]\nshape = 'block'\nsize = [0.2, 0.1, 0.1]\n"
                           "spacing = 0.02\nlattice = 'cells'\n" +
                           body +
                           "[body.material]\nyoung = 1e5\n"
                           "poisson = 0.3\ndensity = 1000\n" +
                           more;
  return LiveScene(parse_scene(text, "scene.toml"), {}, false);
}

Request grab(Index phyxel) {
  Request request{RequestKind::grab};
  request.phyxel = phyxel;
  return request;
}

Request move(Vec3d by) {
  Request request{RequestKind::move};
  request.by = by;
  return request;
}

Request set(const Settings& settings) {
  Request request{RequestKind::set};
  request.settings = settings;
  return request;
}

double mass_of(const LiveScene& live) {
  double mass = 0;
  for (const Part& part : live.model().parts) mass += part.mass;
  return mass;
}

TEST(Hand, GivesTheBodyItsWorkAndItsImpulse) {
  LiveScene live = block();
  live.apply(grab(3));
  for (const Vec3d by : {Vec3d{0.05, 0, 0.02}, Vec3d{0.1, 0.1, 0}, Vec3d{-0.1, 0, 0.1}}) {
    live.apply(move(by));
    live.advance(151);  // not a multiple of the hand's interval
    // Energies at a time know nothing of half a step of the hand's present force.
    const double energy = live.look().total_energy();
    EXPECT_NEAR(energy / live.hand_work(), 1, 0.02);
  }
  live.apply({RequestKind::drop});
  const Diagnostics after = live.look();
  // The impulse of forces is the momentum of a free body, to rounding.
  EXPECT_GT(norm(live.hand_impulse()), 0.1);
  // `momentum` is of velocities at the time of the state, half a step after the last impulse, which
  // internal forces do not change.
  EXPECT_LT(norm(after.momentum - live.hand_impulse()), 1e-12 * norm(live.hand_impulse()));
  // Verlet's energy differs from that of the motion by the square of the step: a part in 1e4 here.
  EXPECT_GT(live.hand_work(), 0.1);
  EXPECT_NEAR(after.total_energy() / live.hand_work(), 1, 2e-3);
  // Nothing pulls any more: both stay.
  live.advance(500);
  const Diagnostics later = live.look();
  EXPECT_NEAR(later.total_energy() / after.total_energy(), 1, 2e-3);
  EXPECT_LT(norm(later.momentum - after.momentum), 1e-12 * norm(after.momentum));
}

TEST(Hand, BringsWhatItHoldsToItsPlace) {
  // The hand damps the body itself: it has hardly any damping of its own.
  LiveScene live = block({}, "damping = 0.5\n");
  live.apply(grab(3));
  const Vec3d by{0.05, -0.02, 0.1};
  live.apply(move(by));
  live.advance(static_cast<std::int64_t>(2 / live.solver().dt()));
  const Vec3d at = live.solver().state().displacement[3];
  EXPECT_LT(norm(at - by), 0.15 * norm(by));  // it turns and rings about the middle of the patch
}

TEST(Hand, NeverHurtsTheStep) {
  // A jerk by a hundred times the body's length: the force is limited, and the state stays finite.
  LiveScene live = block();
  live.apply(grab(3));
  for (int k = 0; k < 20; ++k) {
    live.apply(move({k % 2 == 0 ? 20.0 : -20.0, 5, 0}));
    live.advance(50);
    EXPECT_NO_THROW(live.look()) << k;
  }
  EXPECT_EQ(live.now().inverted, 0);
  live.apply({RequestKind::drop});
  const double energy = live.look().total_energy();
  live.advance(2000);
  EXPECT_NEAR(live.look().total_energy() / energy, 1, 0.01);
}

TEST(Hand, RefusesAPhyxelThatIsNotThere) {
  LiveScene live = block();
  const Index count = live.model().global_count();
  try {
    live.apply(grab(count));
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(std::to_string(count)), std::string::npos);
  }
  EXPECT_FALSE(live.is_held());
}

TEST(Settings, OfGravityActAtOnce) {
  LiveScene live = block();
  live.advance(100);
  live.apply(set({.gravity = Vec3d{0, 0, -5}}));
  const double start = live.solver().time();
  live.advance(400);
  const double fall = live.solver().time() - start;
  EXPECT_NEAR(live.look().momentum.z, -5 * fall * mass_of(live), 1e-9);
  EXPECT_EQ(live.scene().gravity.z, -5);
}

TEST(Settings, OfStiffnessKeepMotionAndMomentum) {
  LiveScene live = block("gravity = [0, 0, -10]\n", "[[body.fixed]]\nregion = 'x-'\n");
  live.advance(300);
  const Diagnostics before = live.look();
  const double time = live.solver().time(), dt = live.solver().dt();
  const State state = live.solver().state();
  live.apply(set({.stiffness = 4.0}));
  const Diagnostics after = live.look();
  // Young's modulus times four halves the step; the time and the places are the same.
  EXPECT_NEAR(live.solver().dt(), dt / 2, 0.01 * dt);
  EXPECT_DOUBLE_EQ(live.solver().time(), time);
  EXPECT_EQ(live.solver().state().displacement, state.displacement);
  EXPECT_NEAR(after.strain_energy, 4 * before.strain_energy, 1e-9 * after.strain_energy);
  // Velocities centred at the same time differ by how forces change within a step.
  EXPECT_NEAR(after.kinetic_energy, before.kinetic_energy, 2e-3 * before.kinetic_energy);
  live.advance(1000);
  EXPECT_NEAR(live.look().total_energy(), after.total_energy(),
              0.01 * (after.kinetic_energy + after.strain_energy));
}

TEST(Settings, ThatCannotBeAreRefusedAndChangeNothing) {
  // Steps of a given size, which a stiffer material makes unstable.
  LiveScene live = block({}, "[body.neighbours]\nsupport = 'uniform'\n");
  const double dt = live.solver().dt();
  Scene scene = live.scene();
  scene.time.step = dt;
  LiveScene given(scene, {}, false);
  given.advance(10);
  const State before = given.solver().state();
  EXPECT_THROW(given.apply(set({.stiffness = 100.0})), InputError);
  EXPECT_EQ(given.solver().state().velocity, before.velocity);
  EXPECT_EQ(given.scene().bodies[0].material.young, 1e5);
  given.advance(10);
  EXPECT_EQ(given.solver().steps(), 20);
}

TEST(Settings, OfFrictionReachAllContacts) {
  const Scene scene = parse_scene(
      "gravity = [0, 0, -10]\n[time]\nend = 1\n[contact]\nfriction = 0.2\nkinetic_friction = 0.1\n"
      "[[obstacle]]\nname = 'floor'\nshape = 'plane'\nfriction = 0.3\n"
      "[[body]]\nshape = 'block'\nsize = [1, 1, 1]\nspacing = 0.2\ntranslation = [0, 0, 1]\n"
      "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n",
      "scene.toml");
  const Scene changed = with_settings(scene, {.friction = 0.7});
  EXPECT_EQ(changed.contact->friction, 0.7);
  EXPECT_FALSE(changed.contact->kinetic_friction);
  EXPECT_EQ(changed.obstacles[0].friction, 0.7);
  EXPECT_EQ(scene_parameters(with_settings(scene, {})), scene_parameters(scene));
}

TEST(LiveScene, BeginsAnewAsItBegan) {
  LiveScene live = block("gravity = [0, 0, -10]\n", {}, "velocity = [1, 2, 3]\n");
  const State start = live.solver().state();
  live.advance(100);
  live.apply(grab(5));
  live.apply(move({1, 0, 0}));
  live.advance(100);
  live.apply({RequestKind::drop});
  EXPECT_GT(live.hand_work(), 0);
  live.apply(grab(5));
  live.apply(move({0, 1, 0}));
  live.advance(20);
  live.apply({RequestKind::reset});
  EXPECT_EQ(live.solver().time(), 0);
  EXPECT_EQ(live.solver().state().velocity, start.velocity);
  EXPECT_EQ(live.solver().state().displacement, start.displacement);
  EXPECT_EQ(live.hand_work(), 0);
  EXPECT_FALSE(live.is_held());
  EXPECT_EQ(norm(live.hand_impulse()), 0);
  EXPECT_EQ(live.taken(), 220);
}

TEST(LiveScene, RefusesASearchForRest) {
  const Scene scene = parse_scene(
      "[solver]\nmethod = 'equilibrium'\nprecision = 'double'\n[[body]]\nshape = 'block'\n"
      "size = [1, 1, 1]\nspacing = 0.2\n[body.material]\nyoung = 1e5\npoisson = 0.3\n"
      "density = 1000\n[[body.fixed]]\nregion = 'x-'\n",
      "scene.toml");
  EXPECT_THROW(LiveScene(scene, {}, false), InputError);
}

}  // namespace
}  // namespace phyxel::app
