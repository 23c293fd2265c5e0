/// Contact by penalties in Verlet's steps: energies that close to second order, momenta, impacts of
/// bars, friction, changes of the step, restarts, and the step limit.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "phyxel/error.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

const std::string penalty = "method = 'penalty'\n", touching = "[contact]\n" + penalty;

/// A ball that flies against something, 7 phyxels across; c is 11.6 m/s.
std::string ball(const std::string& floor, const std::string& more = "velocity = [0, 0, -0.5]\n") {
  return end + floor +
         body("ball", "shape = 'sphere'\nradius = 0.1\nspacing = 0.03\n",
              "translation = [0, 0, 0.101]\n" + more);
}

/// The largest change of the total energy on the way to a time [s], as a share of that at the
/// start, and the largest share that contact has stored.
std::pair<double, double> energy_of(const std::string& text, double step, double time) {
  Way way(text, step);
  const double start = way.energy();
  double worst = 0, stored = 0;
  const std::int64_t steps = std::llround(time / step),
                     each = std::max<std::int64_t>(steps / 400, 1);
  for (std::int64_t k = 0; k < steps; k += each) {
    way.solver.step(each);
    const Diagnostics d = diagnose(way.model, *way.backend, way.solver);
    worst = std::max(worst, std::abs(d.total_energy() - start));
    stored = std::max(stored, d.contact_energy);
  }
  return {worst / start, stored / start};
}

TEST(PenaltyContacts, CloseTheEnergyOfABounceToSecondOrder) {
  const std::string plane = obstacle("shape = 'plane'\n");
  const auto [coarse, stored] = energy_of(ball(plane + penalty), 1e-3, 0.15);
  const double fine = energy_of(ball(plane + penalty), 5e-4, 0.15).first;
  const double projected = energy_of(ball(plane), 5e-4, 0.15).first;
  EXPECT_GT(stored, 0.1);  // the springs are soft, and take a good part of the energy
  EXPECT_LT(coarse, 4e-3);
  EXPECT_NEAR(coarse / fine, 4, 0.6);  // second order
  EXPECT_GT(projected, 10 * fine);     // what the surface layer loses in its impact
}

TEST(PenaltyContacts, CloseTheEnergyOfACollisionToSecondOrder) {
  const auto balls = [](const std::string& contact) {
    const std::string shape = "shape = 'sphere'\nradius = 0.1\nspacing = 0.03\n";
    return end + contact +
           body("left", shape, "translation = [-0.101, 0, 0]\nvelocity = [0.5, 0, 0]\n") +
           body("right", shape, "translation = [0.101, 0.03, 0.01]\nvelocity = [-0.5, 0, 0]\n");
  };
  const auto [coarse, stored] = energy_of(balls(touching), 1e-3, 0.12);
  const double fine = energy_of(balls(touching), 5e-4, 0.12).first;
  const double projected = energy_of(balls("[contact]\n"), 5e-4, 0.12).first;
  const auto lost = [&](const std::string& contact) {
    Way way(balls(contact), 5e-4);
    const double start = way.energy();
    way.solver.step(400);
    EXPECT_EQ(norm(way.contacts()[0].force), 0);  // they have parted
    return diagnose(way.model, *way.backend, way.solver).contact_loss / start;
  };
  EXPECT_GT(stored, 0.1);
  EXPECT_LT(coarse, 0.012);
  EXPECT_NEAR(coarse / fine, 4, 0.4);  // second order
  EXPECT_GT(projected, 2 * fine);
  // Normals that turn with the surfaces take a little.
  EXPECT_LT(std::abs(lost(touching)), 0.02);
  EXPECT_GT(lost("[contact]\n"), 3 * std::abs(lost(touching)));
}

TEST(PenaltyContacts, LetEqualBarsExchangeTheirVelocities) {
  const std::string bar =
      "shape = 'beam'\nsize = [2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n";
  Way way(
      end + touching +
          body("first", bar, "translation = [-2.0001, 0, 0]\nvelocity = [0.1, 0, 0]\n", 1e5, 0) +
          body("second", bar, "", 1e5, 0),
      5e-4);
  const double start = way.energy();
  double begin = 0, last = 0, worst = 0, stored = 0, lost = 0;
  for (int k = 0; k < 1200; ++k) {
    way.solver.step();
    if (k % 4 != 0) continue;
    if (way.contacts()[1].force.x > 0) {
      if (begin == 0) begin = way.solver.time();
      last = way.solver.time();
    }
    const Diagnostics d = diagnose(way.model, *way.backend, way.solver);
    worst = std::max(worst, std::abs(d.total_energy() - start));
    stored = std::max(stored, d.contact_energy);
    lost = std::max(lost, std::abs(d.contact_loss));
  }
  const auto velocity = [&](std::size_t part) {
    const State state = way.solver.state();
    const Part& p = way.model.parts[part];
    double sum = 0, mass = 0;
    for (Index i = p.begin; i < p.end; ++i) {
      sum += way.model.mass[i] * state.velocity[i].x;
      mass += way.model.mass[i];
    }
    return sum / mass;
  };
  // Goldsmith 1960: 2 L/c with c = 10 m/s. Soft springs make it longer.
  EXPECT_NEAR((last - begin) / (2 * 2 / 10.0), 1.06, 0.03);
  EXPECT_NEAR(velocity(0), 0, 0.003);
  EXPECT_NEAR(velocity(1), 0.1, 0.003);
  // Projection loses 1 to 2%, the impact of the layers that meet.
  EXPECT_LT(worst / start, 2e-3);
  // Flat faces hardly turn: what they take from the motion is in the springs, but for 3% at most.
  EXPECT_GT(stored / start, 0.02);
  EXPECT_LT(lost, 0.05 * stored);
}

/// Two balls that meet off their line of centres, spinning.
std::string meeting_balls(const std::string& contact) {
  const std::string shape = "shape = 'sphere'\nradius = 0.1\nspacing = 0.03\n";
  return end + contact +
         body("left", shape,
              "translation = [-0.105, 0, 0]\nvelocity = [0.5, 0, 0]\nspin = [0, 3, 5]\n") +
         body("right", shape,
              "translation = [0.105, 0.05, 0.01]\nvelocity = [-0.5, 0, 0]\nspin = [2, 0, 4]\n");
}

TEST(PenaltyContacts, KeepBothMomentaToRounding) {
  for (const Precision precision : {Precision::double_, Precision::mixed, Precision::single}) {
    Way way(meeting_balls(touching + "friction = 0.4\n"), dt, precision);
    const double scale = way.mass() * 1;  // of momenta; speeds are 1 m/s
    const Vec3d momentum = way.momentum();
    // Velocities belong to half steps: about places before a step it is kept exactly.
    const auto turning = [&] {
      const State s = way.solver.state();
      Vec3d all;
      for (Index i = 0; i < way.model.size(); ++i) {
        const Vec3d x = way.model.position[i] + s.displacement[i] - dt * s.velocity[i];
        all += way.model.mass[i] * cross(x, s.velocity[i]);
      }
      return all;
    };
    way.solver.step();
    const Vec3d before = turning();
    way.solver.step(300);
    const std::vector<ContactReading> contacts = way.contacts();
    EXPECT_GT(norm(contacts[0].impulse), 0.1 * scale);
    const double rounding = precision == Precision::double_ ? 1e-13 : 2e-5;
    EXPECT_LE(norm(way.momentum() - momentum), rounding * scale) << precision_name(precision);
    EXPECT_LE(norm(turning() - before), rounding * scale * 0.1) << precision_name(precision);
    EXPECT_LE(norm(contacts[0].impulse + contacts[1].impulse), 1e-13 * scale);
    EXPECT_GT(contacts[0].friction_heat + contacts[1].friction_heat, 0);
  }
}

TEST(PenaltyContacts, CloseTheLedgerWithFriction) {
  const auto error_of = [](double step) {
    Way way(meeting_balls(touching + "friction = 0.4\n"), step);
    const double start = way.energy();
    way.solver.step(std::llround(0.25 / step));
    EXPECT_EQ(norm(way.contacts()[0].force), 0);  // they have parted
    return std::abs(way.energy() - start) / start;
  };
  const double coarse = error_of(dt), fine = error_of(dt / 4);
  EXPECT_LE(coarse, 2e-3);
  EXPECT_LE(fine, 0.5 * coarse);
}

TEST(PenaltyContacts, CountTheWorkOfAnObstacleThatMoves) {
  Way way(
      ball(obstacle("shape = 'plane'\n" + penalty + "[obstacle.motion]\nvelocity = [0, 0, 0.4]\n"),
           ""),
      2.5e-4);
  const double start = way.energy();
  way.solver.step(800);
  const ContactReading floor = way.contacts()[0];
  EXPECT_EQ(floor.depth, 0);  // it flies
  // An unmovable mass gives a ball about twice its speed.
  EXPECT_NEAR(floor.impulse.z, 0.8 * way.mass(), 0.08 * way.mass());
  EXPECT_EQ(floor.impact_loss, 0);
  // Rectangles in time, whose ends are zero, are trapezoids, but the speed is that of points a
  // layer inside: second order in the step.
  EXPECT_NEAR(way.energy() - start, floor.work, 1e-3 * floor.work);
}

TEST(PenaltyContacts, HoldABlockAtItsWeight) {
  Way way("gravity = [0, 0, -9.81]\n" + end + touching + obstacle("shape = 'plane'\n") +
              body("lower", "shape = 'block'\nsize = [0.2, 0.2, 0.1]\nspacing = 0.05\n",
                   "translation = [0, 0, 0.05]\n") +
              "damping = 20\n" +
              body("upper", "shape = 'block'\nsize = [0.15, 0.15, 0.1]\nspacing = 0.05\n",
                   "translation = [0, 0, 0.15]\n") +
              "damping = 20\n",
          dt);
  way.solver.step(4000);
  const std::vector<ContactReading> contacts = way.contacts();
  const double weight = 9.81 * way.mass(), upper = 9.81 * 1000 * 0.15 * 0.15 * 0.1;
  EXPECT_NEAR(contacts[0].force.z, weight, 2e-3 * weight);  // after e^-20 of its swinging
  EXPECT_NEAR(contacts[2].force.z, upper, 2e-3 * upper);
  EXPECT_GT(contacts[2].depth + contacts[1].depth, 0);
}

TEST(PenaltyContacts, KeepTheirEnergyWhereTheStepChanges) {
  Way way(ball(obstacle("shape = 'plane'\n" + penalty)), 1e-3);
  const double start = way.energy();
  way.solver.step(30);
  EXPECT_GT(norm(way.contacts()[0].force), 0);
  const double before = way.energy();
  way.solver.halve_step();
  // Of second order in the step, as the energy itself. A quarter of a step without the springs'
  // forces would change it by 3e-3.
  EXPECT_NEAR(way.energy(), before, 1e-4 * start);
  way.solver.step(10);
  EXPECT_NEAR(way.energy(), start, 4e-3 * start);
  way.solver.double_step();
  way.solver.step(100);
  EXPECT_NEAR(way.energy(), start, 4e-3 * start);
}

TEST(PenaltyContacts, HaveTheSameBitsOnAnyThreadsAndAfterARestart) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    const std::string text =
        meeting_balls(touching + "friction = 0.4\n" +
                      obstacle("shape = 'plane'\ntranslation = [0, 0, -0.1005]\n"
                               "friction = 0.2\n"));
    Way one(text, dt, precision, 1), three(text, dt, precision, 3);
    one.solver.step(220);
    three.solver.step(120);
    EXPECT_GT(norm(three.contacts()[1].force), 0.1);
    Way resumed(text, dt, precision, 2);
    Solver next(resumed.model, *resumed.backend, three.solver.state(), Method::verlet);
    next.step(100);
    const State expected = one.solver.state(), found = next.state();
    EXPECT_EQ(expected.displacement, found.displacement);
    EXPECT_EQ(expected.velocity, found.velocity);
    EXPECT_EQ(expected.step_sums, found.step_sums);
  }
}

TEST(PenaltyContacts, ShortenTheLargestStep) {
  const auto limit_of = [](const std::string& contact) {
    const Model model = build_model(parse_scene(meeting_balls(contact), "scene.toml"));
    return step_limit(model).largest_step;
  };
  const double projected = limit_of("[contact]\n"), soft = limit_of(touching);
  EXPECT_LT(soft, 0.97 * projected);
  EXPECT_GT(soft, 0.7 * projected);
  const std::string stiff = touching + "stiffness = 3\n";
  EXPECT_LT(limit_of(stiff), 0.5 * projected);
  // Steps that are hardly shorter are stable: no energy is made.
  Way way(meeting_balls(stiff), 0.95 * limit_of(stiff));
  const double start = way.energy();
  way.solver.step(std::llround(0.25 / way.solver.dt()));
  EXPECT_GT(norm(way.contacts()[0].impulse), 0.1);
  EXPECT_NEAR(way.energy(), start, 0.05 * start);
}

TEST(PenaltyContacts, OfObstaclesAreThoseOfTheSceneUnlessTheyAreTold) {
  const auto stiffness = [](const std::string& text) {
    std::vector<double> all;
    for (const Obstacle& o : build_model(parse_scene(text, "scene.toml")).obstacles) {
      all.push_back(o.penalty);
    }
    return all;
  };
  const std::string plane = "shape = 'plane'\n";
  EXPECT_EQ(stiffness(ball(obstacle(plane) + obstacle(plane + penalty) +
                           obstacle(plane + penalty + "stiffness = 2\n"))),
            (std::vector<double>{0, 0.1, 2}));
  EXPECT_EQ(stiffness(ball(touching + "stiffness = 3\n" + obstacle(plane) +
                           obstacle(plane + "method = 'projected'\n") +
                           obstacle(plane + "stiffness = 4\n"))),
            (std::vector<double>{3, 0, 4}));
}

TEST(PenaltyContacts, HaveNoRestitution) {
  const auto refusal = [](const std::string& text) {
    try {
      parse_scene(text, "scene.toml");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const std::string bounce = "restitution = 0.5\n", plane = obstacle("shape = 'plane'\n");
  const std::string why =
      "0.5 found with method = \"penalty\", whose springs give back all that they take; allowed: "
      "0, or method = \"projected\"";
  EXPECT_EQ(refusal(ball(touching + bounce)), "scene.toml:3:1: key contact.restitution: " + why);
  for (const std::string& text : {plane + penalty + bounce, touching + plane + bounce}) {
    EXPECT_THAT(refusal(ball(text)), ::testing::HasSubstr("key obstacle.restitution: of obstacle "
                                                          "\"obstacle 1\": " +
                                                          why));
  }
  EXPECT_EQ(refusal(ball(touching + plane + "method = 'projected'\n" + bounce)), "accepted");
}

TEST(PenaltyContacts, MayBeNamedForImplicitStepsWhichAlwaysUseThem) {
  const std::string implicit = "[solver]\nmethod = 'implicit'\n";
  Way asked(implicit + ball(obstacle("shape = 'plane'\n" + penalty)), 2e-3),
      not_asked(implicit + ball(obstacle("shape = 'plane'\n")), 2e-3);
  asked.solver.step(5);
  not_asked.solver.step(5);
  EXPECT_EQ(asked.solver.state().displacement, not_asked.solver.state().displacement);
}

}  // namespace
}  // namespace phyxel
