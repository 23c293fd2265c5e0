/// Contact with obstacles against mechanics: momenta, energies, Coulomb's friction, rolling,
/// bouncing.
#include "phyxel/contacts.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double degree = std::numbers::pi / 180;

/// A block on a plane that is inclined by an angle, which gravity turned by that angle stands for.
std::string slope(double angle, double friction, const std::string& more = "") {
  return fmt::format("gravity = [{}, 0, {}]\n{}{}{}", 9.81 * std::sin(angle),
                     -9.81 * std::cos(angle), end,
                     obstacle(fmt::format("shape = 'plane'\ntranslation = [0, 0, -0.1]\n"
                                          "friction = {}\n{}",
                                          friction, more)),
                     block());
}

TEST(Contacts, HoldABlockOnASlopeBelowTheAngleOfFriction) {
  // tan 21.8° = 0.4
  Way way(slope(21.8 * degree, 0.5), dt);
  way.solver.step(12000);  // the block sinks into its rest, swinging
  const double before = way.centre().x, heat = way.contacts()[0].friction_heat;
  way.solver.step(10000);
  constexpr double spacing = 0.05;
  EXPECT_LE(std::abs(way.centre().x - before), 1e-6 * spacing);
  const std::vector<ContactReading> contacts = way.contacts();
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].obstacle, "obstacle 1");
  EXPECT_EQ(contacts[0].shape, "plane");
  EXPECT_EQ(contacts[0].friction_heat, heat);
  const Vec3d weight = way.mass() * way.model.gravity;
  EXPECT_LE(norm(contacts[0].force + weight), 1e-6 * norm(weight));
}

/// The mean acceleration down a slope of a block that has settled, over half a second [m/s²].
double acceleration_of(const std::string& text) {
  Way way(text, dt);
  way.solver.step(1000);
  const double before = way.momentum().x;
  way.solver.step(1000);
  return (way.momentum().x - before) / way.mass() / 0.5;
}

TEST(Contacts, LetABlockSlideAboveTheAngleOfFriction) {
  const double angle = 30 * degree, mu = 0.3;
  const double expected = 9.81 * (std::sin(angle) - mu * std::cos(angle));
  // The rest of its swinging changes the mean force by 1e-4.
  EXPECT_NEAR(acceleration_of(slope(angle, mu)), expected, 1e-3 * expected);
}

TEST(Contacts, OfSlidingPointsHaveTheKineticFriction) {
  const double angle = std::atan(0.25);
  const std::string text = slope(angle, 0.7, "kinetic_friction = 0.2\n");
  std::string sliding = text;
  sliding.replace(text.find("lattice"), 0, "velocity = [1, 0, 0]\n");
  const double expected = 9.81 * (std::sin(angle) - 0.2 * std::cos(angle));
  EXPECT_NEAR(acceleration_of(sliding), expected, 5e-3 * expected);
  // One that rests is held by static friction.
  EXPECT_NEAR(acceleration_of(text), 0, 5e-3 * expected);
}

/// A ball that spins and flies at an angle into a corner of two obstacles, one of which moves.
std::string corner(const std::string& more = "") {
  return "gravity = [0, 0, -9.81]\n" + end +
         obstacle("name = 'floor'\nshape = 'plane'\nfriction = 0.4\nrestitution = 0.3\n") +
         obstacle(
             "name = 'post'\nshape = 'cylinder'\nradius = 0.1\nlength = 1\n"
             "translation = [0.6, 0.05, 0.3]\nrotation = [0, 40, 0]\nfriction = 0.2\n"
             "[obstacle.motion]\nvelocity = [-0.5, 0, 0]\namplitude = [0, 0.02, 0]\n"
             "frequency = 5\n") +
         "[[body]]\nshape = 'sphere'\nradius = 0.1\nspacing = 0.04\nvelocity = [1, 0, -1]\n"
         "spin = [0, 10, 5]\ntranslation = [0, 0, 0.11]\n" +
         more + "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n";
}

TEST(Contacts, AndGravityMakeAllChangesOfMomenta) {
  for (const Precision precision : {Precision::double_, Precision::mixed, Precision::single}) {
    Way way(corner(), dt, precision);
    Vec3d origin;
    Vec3d before = way.momentum(), turning = way.angular_momentum(origin);
    Vec3d impulse, moment;
    double worst = 0, worst_moment = 0;
    for (int k = 0; k < 300; ++k) {
      const Vec3d weight = way.mass() * way.model.gravity;
      // The torque of weights where phyxels are at the beginning of the step.
      const Vec3d torque = cross(way.centre(), weight);
      way.solver.step();
      const std::vector<ContactReading> contacts = way.contacts();
      Vec3d all, all_moments;
      for (const ContactReading& c : contacts) {
        all += c.impulse;
        all_moments += c.angular_impulse + cross(c.place, c.impulse);
      }
      const Vec3d after = way.momentum();
      // Velocities belong to half steps, positions to whole ones.
      const State state = way.solver.state();
      Vec3d turning_after;
      for (Index i = 0; i < way.model.size(); ++i) {
        const Vec3d x = way.model.position[i] + state.displacement[i] - dt * state.velocity[i];
        turning_after += way.model.mass[i] * cross(x, state.velocity[i]);
      }
      worst = std::max(worst, norm(after - before - dt * weight - (all - impulse)));
      worst_moment = std::max(worst_moment,
                              norm(turning_after - turning - dt * torque - (all_moments - moment)));
      impulse = all;
      moment = all_moments;
      before = after;
      turning = way.angular_momentum(origin);
    }
    EXPECT_GT(norm(impulse), 3);
    const double rounding = precision == Precision::double_ ? 1e-14 : 1e-5;
    EXPECT_LE(worst, rounding * 4) << precision_name(precision);
    EXPECT_LE(worst_moment, rounding * 4) << precision_name(precision);
  }
}

TEST(Contacts, CloseTheLedgerOfEnergies) {
  const auto error_of = [](double step) {
    Way way(corner(), step);
    const double start = way.energy();
    way.solver.step(std::llround(0.2 / step));
    double work = 0, heat = 0, loss = 0;
    for (const ContactReading& c : way.contacts()) {
      work += c.work;
      heat += c.friction_heat;
      loss += c.impact_loss;
    }
    EXPECT_GT(heat, 0.1);
    EXPECT_GT(loss, 0.01);
    EXPECT_GT(work, 0.1);
    return std::abs(way.energy() - start - work);
  };
  const double coarse = error_of(dt), fine = error_of(dt / 4);
  EXPECT_LE(coarse, 0.05);
  EXPECT_LE(fine, 0.3 * coarse);
}

constexpr double radius = 0.1;

/// A ball of 4.2 kg above a plane.
std::string ball(double young, double height, const std::string& more, double friction = 0) {
  return "gravity = [0, 0, -9.81]\n" + end +
         obstacle(fmt::format("shape = 'plane'\nfriction = {}\n", friction)) +
         fmt::format(
             "[[body]]\nshape = 'sphere'\nradius = {}\nspacing = 0.02\n"
             "translation = [0, 0, {}]\n{}[body.material]\nyoung = {}\npoisson = 0.3\n"
             "density = 1000\n",
             radius, radius + height, more, young);
}

TEST(Contacts, OfABallLastAsLongAsHertzSays) {
  constexpr double height = 0.05, young = 3e5;
  Way way(ball(young, height, ""), 2e-4);
  const double speed = std::sqrt(2 * 9.81 * height);
  double begin = 0, ended = 0;
  while (ended == 0 && way.solver.time() < 0.3) {
    way.solver.step();
    const bool touches = way.contacts()[0].force.z > 0;
    if (touches && begin == 0) begin = way.solver.time();
    if (begin > 0 && !touches && way.momentum().z > 0) ended = way.solver.time();
  }
  // Hertz 1882: 2.868 (m² / (R E*² V))^(1/5) for a rigid plane, at speeds far below that of waves,
  // here a twentieth. The circle of contact has a radius of two spacings (seen: -0.2%).
  const double stiffness = young / (1 - 0.3 * 0.3), mass = way.mass();
  const double duration =
      2.868 * std::pow(mass * mass / (radius * stiffness * stiffness * speed), 0.2);
  EXPECT_NEAR(ended - begin, duration, 0.03 * duration);
  // Seen: 0.962; 1.1% of the energy are lost where the surface hits the plane.
  EXPECT_NEAR(way.momentum().z / mass / speed, 0.97, 0.02);
  EXPECT_LT(way.contacts()[0].impact_loss, 0.02 * mass * speed * speed / 2);
}

TEST(Contacts, OfASlidingBallMakeItRoll) {
  constexpr double v = 1, mu = 0.2;
  Way way(ball(1e5, 0, "velocity = [1, 0, 0]\n", mu), 4e-4);
  const auto speed = [&] { return way.momentum().x / way.mass(); };
  // It rolls after 2 v / (7 μ g), at 5/7 of its speed. It begins by sinking into its own weight,
  // and a soft ball bounces on (seen: 1.8% less at 1.25 of that time).
  const double time = 2 * v / (7 * mu * 9.81);
  way.solver.step(std::llround(1.25 * time / 4e-4));
  EXPECT_NEAR(speed(), 5.0 / 7 * v, 0.03 * v);
  const Vec3d spin = way.angular_momentum(way.centre());
  EXPECT_NEAR(spin.y, 0.4 * way.mass() * radius * speed(), 0.05 * spin.y);
}

/// The block between plates that press it by 1%, without friction.
std::string press(const std::string& method) {
  return "[solver]\nmethod = '" + method + "'\nprecision = 'double'\n" + end +
         (method == "implicit" ? "step = 0.02\n" : "") +
         obstacle("name = 'table'\nshape = 'plane'\ntranslation = [0, 0, -0.1]\n") +
         obstacle(
             "name = 'ram'\nshape = 'plane'\nnormal = [0, 0, -1]\ntranslation = [0, 0, 0.1]\n"
             "[obstacle.motion]\ndisplacement = [0, 0, -0.002]\nduration = 0.2\n") +
         block();
}

TEST(Contacts, BetweenPlatesStressABlockUniformly) {
  // Without friction, a block between plates is under uniaxial stress.
  std::string text = press("verlet");
  text.replace(text.find("density = 1000"), 14, "density = 1000\ndamping = 60");
  Way way(text, dt);
  way.solver.step(1200);
  const std::vector<ContactReading> contacts = way.contacts();
  // Neo-Hookean stiffness at 1% strain is within 2% of E.
  const double force = 1e5 * 0.01 * 0.04;
  EXPECT_NEAR(contacts[0].force.z, force, 0.03 * force);
  EXPECT_NEAR(contacts[1].force.z, -contacts[0].force.z, 1e-3 * force);
  EXPECT_LE(std::abs(contacts[0].torque.x) + std::abs(contacts[0].torque.y), 1e-6 * force);
  std::vector<double> von_mises;
  stress_fields(way.model, *way.backend, &von_mises, nullptr);
  const auto [least, largest] = std::minmax_element(von_mises.begin(), von_mises.end());
  EXPECT_LE(*largest - *least, 0.06 * *largest);  // edges, where a lattice of nodes is not closed
}

TEST(Contacts, AtRestAndInImplicitStepsAreThoseOfExplicitOnes) {
  Way moves(press("verlet"), dt), steps(press("implicit"), 0.02), rests(press("equilibrium"), 1);
  moves.solver.step(4000);
  steps.solver.step(100);
  rests.solver.step();
  const double force = moves.contacts()[0].force.z;
  EXPECT_GT(force, 30);
  // Penalties are a fifth of a spacing softer at a pressure of E, here 0.01 E: 0.05 (0.01/5) 2 of
  // 0.002 m on both sides, a tenth (seen: 4%).
  for (Way* way : {&steps, &rests}) {
    const std::vector<ContactReading> contacts = way->contacts();
    EXPECT_NEAR(contacts[0].force.z, force, 0.1 * force);
    EXPECT_NEAR(contacts[1].force.z, -contacts[0].force.z, 1e-5 * force);
    EXPECT_GT(contacts[0].depth, 0);
    EXPECT_LT(contacts[0].depth, 0.01 * 0.05);
  }
  EXPECT_NEAR(rests.contacts()[0].force.z, steps.contacts()[0].force.z, 1e-3 * force);
  // Viscosity, and steps that do not resolve what swings, lose some of the work (seen: 8%).
  EXPECT_GT(steps.contacts()[1].work, steps.energy());
  EXPECT_LT(steps.contacts()[1].work, 1.2 * steps.energy());
}

TEST(Contacts, OfImplicitStepsMakeAllChangesOfMomentum) {
  std::string text = corner() + "[solver]\nmethod = 'implicit'\nprecision = 'double'\n";
  const std::string key = "restitution = 0.3\n";
  text.replace(text.find(key), key.size(), "");
  Way way(text, 0.01);
  way.solver.step(30);
  Vec3d expected = way.mass() * (0.3 * way.model.gravity + Vec3d{1, 0, -1});
  for (const ContactReading& c : way.contacts()) expected += c.impulse;
  EXPECT_GT(norm(way.contacts()[0].impulse), 3);
  EXPECT_GT(norm(way.contacts()[1].impulse), 1);
  EXPECT_LE(norm(way.momentum() - expected), 1e-12 * norm(expected));
}

TEST(Contacts, AtRestCarryTheWeight) {
  Way way("gravity = [0, 0, -9.81]\n[solver]\nmethod = 'equilibrium'\nprecision = 'double'\n" +
              end + obstacle("shape = 'plane'\ntranslation = [0, 0, -0.1]\n") + block(),
          1);
  way.solver.step();
  EXPECT_NEAR(way.contacts()[0].force.z, way.mass() * 9.81, 1e-6 * way.mass() * 9.81);
}

TEST(Contacts, OfARollerDoNoWorkWithoutFriction) {
  // A cylinder that turns about its own axis is the same as one that rests, whatever it returns.
  const auto dropped_on = [](double turns, const std::string& more) {
    return "gravity = [0, 0, -9.81]\n" + end +
           obstacle(fmt::format("shape = 'cylinder'\nradius = 0.1\nlength = 0.5\n"
                                "rotation = [90, 0, 0]\ntranslation = [0, 0, -0.2]\n{}"
                                "[obstacle.motion]\nrotation = [0, {}, 0]\n"
                                "about = [0, 0, -0.2]\nduration = 1\n",
                                more, 360 * turns)) +
           block();
  };
  for (const std::string restitution : {"", "restitution = 0.5\n"}) {
    Way turns(dropped_on(20, restitution), dt), rests(dropped_on(1e-9, restitution), dt);
    turns.solver.step(300);
    rests.solver.step(300);
    const ContactReading a = turns.contacts()[0], b = rests.contacts()[0];
    EXPECT_GT(b.impulse.z, 5);
    // Rounding of two rotations that the block feels for a hundred steps.
    EXPECT_LE(norm(a.impulse - b.impulse), 1e-6 * norm(b.impulse));
    EXPECT_LE(std::abs(a.work), 1e-9);
    EXPECT_NEAR(a.impact_loss, b.impact_loss, 1e-6 * b.impact_loss);
  }
}

/// What is said when a block of 0.2 m meets an obstacle, in steps of a millisecond.
std::string met(const std::string& of_obstacle, const std::string& of_block, int steps = 500) {
  try {
    Way way(end + of_obstacle + block(of_block), 1e-3);
    for (int k = 0; k < steps; k += 10) {
      way.energy();
      way.contacts();
      way.solver.step(10);
    }
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing";
}

TEST(Contacts, ThatMightBeMissedAreRefused) {
  const auto plate = [](double thickness) {
    return obstacle(
        fmt::format("shape = 'box'\nsize = [1, 1, {}]\ntranslation = [0, 0, -0.3]\n", thickness));
  };
  const std::string falls = "velocity = [0, 0, -2]\n";
  EXPECT_EQ(met(plate(0.02), falls), "nothing");
  EXPECT_THAT(met(plate(0.002), falls),
              HasSubstr("allowed: 0.0005 m, half of the obstacle's inner radius"));
  EXPECT_THAT(met(obstacle("shape = 'sphere'\nradius = 0.2\ntranslation = [0, 0, -1.2]\n"
                           "[obstacle.motion]\nvelocity = [0, 0, 300]\n"),
                  ""),
              HasSubstr("obstacle \"obstacle 1\" at 300 m/s, 0.3 m against each other in a step"));
  // Planes that cross each other inside the body.
  EXPECT_THAT(met(obstacle("name = 'table'\nshape = 'plane'\ntranslation = [0, 0, -0.1]\n") +
                      obstacle("name = 'ram'\nshape = 'plane'\nnormal = [0, 0, -1]\n"
                               "translation = [0, 0, 0.1]\n[obstacle.motion]\n"
                               "displacement = [0, 0, -0.3]\nduration = 0.4\n"),
                  ""),
              HasSubstr("deep in obstacle \"table\""));
}

TEST(Contacts, AtRestFollowAnObstacleIntoABody) {
  const auto pressed = [](double depth) {
    Way way(end +
                obstacle(fmt::format("shape = 'sphere'\nradius = 0.1\ntranslation = [0, 0, 0.2]\n"
                                     "[obstacle.motion]\ndisplacement = [0, 0, -{}]\n"
                                     "duration = 1\n",
                                     depth)) +
                block("[[body.fixed]]\nregion = 'z-'\n") +
                "[solver]\nmethod = 'equilibrium'\nprecision = 'double'\n",
            1);
    way.solver.step();
    return way.contacts()[0].force.z;
  };
  const double some = pressed(0.01), more = pressed(0.03);
  EXPECT_LT(some, -5);
  EXPECT_LT(more, 2 * some);
}

TEST(Contacts, OfPhyxelsBesideASurfaceActAtTheSurface) {
  // In cells, the lowest phyxels lie half a spacing above the face on which the block stands.
  std::string text = slope(0, 0);
  text.replace(text.find("'nodes'"), 7, "'cells'");
  Way way(text, dt);
  const double start = way.centre().z;
  way.solver.step(2000);
  EXPECT_NEAR(way.contacts()[0].force.z, way.mass() * 9.81, 1e-3 * way.mass() * 9.81);
  // It sinks by the half of its compression, g ρ h² / (2 E) = 2 mm (seen: 0.7 mm).
  EXPECT_LE(start - way.centre().z, 0.002);
}

TEST(Contacts, KeepABodyInsideAHollowBox) {
  Way way("gravity = [0, 0, -9.81]\n" + end +
              obstacle("shape = 'box'\nsize = [0.5, 0.4, 0.6]\nhollow = true\nfriction = 0.3\n") +
              block("velocity = [4, 3, 2]\nspin = [3, 2, 1]\n"),
          dt);
  for (int k = 0; k < 10; ++k) {
    way.solver.step(200);
    const State state = way.solver.state();
    for (Index i = 0; i < way.model.size(); ++i) {
      const Vec3d x = way.model.position[i] + state.displacement[i];
      ASSERT_LE(std::abs(x.x), 0.25 + 1e-3);
      ASSERT_LE(std::abs(x.y), 0.2 + 1e-3);
      ASSERT_LE(std::abs(x.z), 0.3 + 1e-3);
    }
    // A phyxel in an edge is moved along the plane between both faces by friction: less than it
    // moves in a step.
    EXPECT_LE(way.contacts()[0].depth, 2e-3);
  }
}

TEST(Contacts, HaveTheSameBitsOnAnyNumberOfThreadsAndAfterARestart) {
  for (const Precision precision : {Precision::double_, Precision::single}) {
    Way one(corner(), dt, precision, 1), two(corner(), dt, precision, 2);
    one.solver.step(120);
    two.solver.step(70);
    ASSERT_GT(norm(two.contacts()[0].impulse), 1);
    const auto fresh = testing::make_test_backend(two.model, precision, 2);
    Solver resumed(two.model, *fresh, two.solver.state(), Method::verlet);
    resumed.step(50);
    EXPECT_EQ(one.solver.state().displacement, resumed.state().displacement);
    EXPECT_EQ(one.solver.state().velocity, resumed.state().velocity);
    EXPECT_EQ(one.solver.step_sums(), resumed.step_sums());
  }
}

TEST(Contacts, CostNothingWithoutObstacles) {
  Way free(end + block(), dt);
  free.solver.step(2);
  EXPECT_THAT(free.contacts(), IsEmpty());
  EXPECT_THAT(free.model.contact.phyxels, IsEmpty());
  EXPECT_THAT(free.solver.state().step_sums, IsEmpty());
  for (const ArrayBytes& array : free.backend->memory()) {
    EXPECT_EQ(array.name.find("contact"), std::string::npos) << array.name;
  }
}

}  // namespace
}  // namespace phyxel
