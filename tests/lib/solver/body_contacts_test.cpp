/// Bodies that touch each other, against mechanics: momenta, energies, impacts of bars and balls,
/// pressure between lattices that do not match, friction, stacks, and what must not touch.
#include "solver/body_contacts.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "phyxel/error.hpp"
#include "phyxel/reactions.hpp"
#include "support/contact_scene.hpp"
#include "support/strewn_surfaces.hpp"

namespace phyxel {
namespace {

const std::string touching = "[contact]\n";

const std::string ball_shape = "shape = 'sphere'\nradius = 0.1\nspacing = 0.03\n";

/// Two balls that meet off their line of centres, spinning.
std::string meeting_balls(const std::string& contact) {
  return end + contact +
         body("left", ball_shape,
              "translation = [-0.105, 0, 0]\nvelocity = [1, 0, 0]\n"
              "spin = [0, 3, 5]\n") +
         body("right", ball_shape,
              "translation = [0.105, 0.05, 0.01]\nvelocity = [-1, 0, 0]\n"
              "spin = [2, 0, 4]\n");
}

TEST(BodyContacts, KeepBothMomentaToRounding) {
  for (const Precision precision : {Precision::double_, Precision::mixed, Precision::single}) {
    for (const std::string more : {"", "restitution = 0.5\n", "sweeps = 3\n"}) {
      Way way(meeting_balls("[contact]\nfriction = 0.4\n" + more), dt, precision);
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
      double pushed = 0;
      for (int k = 0; k < 300; ++k) {
        way.solver.step();
        pushed = std::max(pushed, norm(way.contacts()[0].force));
      }
      const std::vector<ContactReading> contacts = way.contacts();
      EXPECT_GT(pushed, 10);
      EXPECT_GT(norm(contacts[0].impulse), 0.3 * scale);
      const double rounding = precision == Precision::double_ ? 1e-13 : 2e-5;
      EXPECT_LE(norm(way.momentum() - momentum), rounding * scale) << precision_name(precision);
      EXPECT_LE(norm(turning() - before), rounding * scale * 0.1) << precision_name(precision);
      EXPECT_LE(norm(contacts[0].impulse + contacts[1].impulse), 1e-13 * scale);
    }
  }
}

TEST(BodyContacts, CloseTheLedgerOfEnergies) {
  const auto error_of = [](double step) {
    Way way(meeting_balls("[contact]\nfriction = 0.4\n"), step);
    const double start = way.energy();
    way.solver.step(std::llround(0.15 / step));
    EXPECT_GT(energy_lost(way.contacts()), 0.005 * start);
    const Diagnostics d = diagnose(way.model, *way.backend, way.solver);
    EXPECT_NEAR(d.contact_loss, energy_lost(way.contacts()), 1e-12 * start);
    return std::abs(way.energy() - start) / start;
  };
  const double coarse = error_of(dt), fine = error_of(dt / 4);
  EXPECT_LE(coarse, 5e-3);
  EXPECT_LE(fine, 0.3 * coarse);
}

/// Two bars along x, 4 phyxels across, without Poisson's effect, that meet end to end.
std::string bars(double length, double other) {
  const auto bar = [](double l) {
    return fmt::format(
        "shape = 'beam'\nsize = [{}, 0.2, 0.2]\nspacing = 0.05\n"
        "lattice = 'nodes'\n",
        l);
  };
  return end + touching +
         body("first", bar(length),
              fmt::format("translation = [{}, 0, 0]\nvelocity = [0.1, 0, 0]\n", -length - 1e-4),
              1e5, 0) +
         body("second", bar(other), "", 1e5, 0);
}

/// How long the second body is pushed along x, until it is faster than `speed` [m/s]; steps end
/// `most` [s] after the start.
double time_of_contact(Way& way, double most, double speed) {
  double begin = 0, ended = 0;
  while (ended == 0 && way.solver.time() < most) {
    way.solver.step();
    const bool touches = way.contacts()[1].force.x > 0;
    if (touches && begin == 0) begin = way.solver.time();
    if (begin > 0 && !touches && velocity_of(way, 1).x > speed) ended = way.solver.time();
  }
  return ended - begin;
}

TEST(BodyContacts, LetEqualBarsExchangeTheirVelocities) {
  Way way(bars(2, 2), 5e-4);
  const double start = way.energy(), speed_of_sound = 10;
  const double duration = time_of_contact(way, 1, 0.09);
  // Goldsmith 1960: 2 L/c. 4 across, the outermost half layer is a part of the length.
  EXPECT_NEAR(duration / (2 * 2 / speed_of_sound), 1, 0.03);
  EXPECT_NEAR(velocity_of(way, 0).x, 0, 0.003);
  EXPECT_NEAR(velocity_of(way, 1).x, 0.1, 0.003);
  // The layers that meet lose what an inelastic impact of half a layer does.
  EXPECT_NEAR(energy_lost(way.contacts()) / start, 0, 0.02);
}

TEST(BodyContacts, LetAShortBarStopAtALongOne) {
  Way way(bars(1, 2), 5e-4);
  way.solver.step(std::llround(0.5 / 5e-4));
  // Saint-Venant: the short one stops, the long one has half its speed on average.
  EXPECT_NEAR(velocity_of(way, 0).x, 0, 0.004);
  EXPECT_NEAR(velocity_of(way, 1).x, 0.05, 0.002);
}

/// The time that two balls of 0.2 m touch each other over Hertz's, and the part of their speed with
/// which they part.
std::pair<double, double> impact_of_balls(double spacing) {
  constexpr double radius = 0.1, speed = 1.5, young = 3e5;
  const std::string shape = fmt::format("shape = 'sphere'\nradius = 0.1\nspacing = {}\n", spacing);
  Way way(
      end + touching +
          body("left", shape, "translation = [-0.1001, 0, 0]\nvelocity = [0.75, 0, 0]\n", young) +
          body("right", shape, "translation = [0.1001, 0, 0]\nvelocity = [-0.75, 0, 0]\n", young),
      2e-4);
  const double found = time_of_contact(way, 0.5, 0);
  // Hertz 1882: 2.868 (m*² / (R* E*² V))^(1/5).
  const double stiffness = young / (1 - 0.3 * 0.3) / 2, mass = way.mass() / 4;
  const double duration =
      2.868 * std::pow(mass * mass / (radius / 2 * stiffness * stiffness * speed), 0.2);
  return {found / duration, (velocity_of(way, 1).x - velocity_of(way, 0).x) / speed};
}

TEST(BodyContacts, OfBallsConvergeToHertz) {
  const auto [coarse, coarse_rebound] = impact_of_balls(0.034);
  const auto [fine, fine_rebound] = impact_of_balls(0.02);
  // The circle of contact has a radius of one and of two spacings. Each row of phyxels begins to
  // carry when it touches, so that the balls are too stiff by a part of a row.
  EXPECT_NEAR(fine, 1, 0.09);
  EXPECT_LT(std::abs(fine - 1), 0.9 * std::abs(coarse - 1));
  EXPECT_GT(fine_rebound, 0.9);
  EXPECT_GT(fine_rebound, coarse_rebound);
}

/// Two blocks, one on the other, that a plate presses by 1%. Their lattices do not match.
std::string patch(const std::string& more, double turn) {
  const auto block_of = [&](double spacing) {
    return fmt::format("shape = 'block'\nsize = [0.4, 0.4, 0.2]\nspacing = {}\nlattice = 'nodes'\n",
                       spacing);
  };
  const std::string damped = "damping = 20\n";
  return end + touching + more + obstacle("shape = 'plane'\ntranslation = [0, 0, -0.2]\n") +
         obstacle(
             "shape = 'plane'\nnormal = [0, 0, -1]\ntranslation = [0, 0, 0.2]\n"
             "[obstacle.motion]\ndisplacement = [0, 0, -0.004]\nduration = 0.2\n") +
         body("lower", block_of(0.05), "translation = [0, 0, -0.1]\n", 1e5, 0) + damped +
         body("upper", block_of(0.04),
              fmt::format("translation = [0, 0, 0.1]\nrotation = [0, 0, {}]\n", turn), 1e5, 0) +
         damped;
}

TEST(BodyContacts, PassPressureOnBetweenLatticesThatDoNotMatch) {
  Way way(patch("sweeps = 2\n", 0), 5e-4);
  way.solver.step(4000);
  std::vector<Mat3d> gradient;
  way.backend->displacement_gradients(gradient);
  // Poisson's ratio is 0: the stress is E times the strain, 1% of the height less what the blocks
  // sink into each other.
  double sum = 0, squares = 0, volume = 0;
  for (Index i = 0; i < way.model.size(); ++i) {
    const double v = way.model.volume[i], strain = gradient[i](2, 2);
    sum += v * strain;
    squares += v * strain * strain;
    volume += v;
  }
  const double mean = sum / volume;
  EXPECT_NEAR(mean, -0.01, 5e-5);
  // At the corners, which lie on each other, it is a quarter off.
  EXPECT_LE(std::sqrt(squares / volume - mean * mean), 0.03 * std::abs(mean));
  EXPECT_NEAR(way.contacts()[1].force.z / (1e5 * 0.16 * mean), 1, 0.01);
}

TEST(BodyContacts, HoldABlockOnAnotherOneByFriction) {
  // An inclined plane, which gravity turned by that angle stands for; the lower block is held.
  const auto slid = [](double friction) {
    const double angle = 21.8 * std::numbers::pi / 180;  // tan 21.8° = 0.4
    Way way(fmt::format("gravity = [{}, 0, {}]\n{}[contact]\nfriction = {}\n",
                        9.81 * std::sin(angle), -9.81 * std::cos(angle), end, friction) +
                body("slope",
                     "shape = 'block'\nsize = [1.2, 0.3, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n",
                     "translation = [0.3, 0, -0.1]\n[[body.fixed]]\nall = true\n") +
                body("block",
                     "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n",
                     "translation = [0, 0.012, 0.1]\n") +
                "viscosity = 0.004\n",
            dt);
    way.solver.step(1200);
    const double before = velocity_of(way, 1).x;
    way.solver.step(400);
    return (velocity_of(way, 1).x - before) / (400 * dt);
  };
  const double angle = 21.8 * std::numbers::pi / 180;
  // It still swings by a hundredth of g sin 21.8°.
  EXPECT_NEAR(slid(0.5), 0, 0.04);
  const double expected = 9.81 * (std::sin(angle) - 0.2 * std::cos(angle));
  EXPECT_NEAR(slid(0.2), expected, 0.02 * expected);
}

TEST(BodyContacts, DoNotActBesideFaces) {
  // A block slides down beside another one, half a spacing away, past its edge.
  const std::string shape =
      "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n";
  Way way(
      end + touching + body("still", shape, "") +
          body("passing", shape, "translation = [0.225, 0.013, 0.22]\nvelocity = [0, 0, -0.5]\n"),
      dt);
  way.solver.step(1700);  // 0.42 m
  EXPECT_EQ(way.contacts()[0].impulse, Vec3d{});
  EXPECT_NEAR(velocity_of(way, 1).z, -0.5, 1e-9);
}

TEST(BodyContacts, AreOfSomePairsAloneIfAsked) {
  const std::string shape =
      "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n";
  const auto pushed = [&](const std::string& contact) {
    Way way(end + contact + body("a", shape, "velocity = [1, 0, 0]\n") +
                body("b", shape, "translation = [0.23, 0, 0]\n") +
                body("c", shape, "translation = [-0.23, 0, 0]\nvelocity = [2, 0, 0]\n"),
            dt);
    way.solver.step(150);
    std::vector<char> touched;
    for (const ContactReading& c : way.contacts()) touched.push_back(c.impulse != Vec3d{});
    return touched;
  };
  EXPECT_EQ(pushed(touching), (std::vector<char>{1, 1, 1}));
  EXPECT_EQ(pushed("[contact]\n[[contact.pair]]\nfirst = 'b'\nsecond = 'a'\n"),
            (std::vector<char>{1, 1, 0}));
}

TEST(BodyContacts, HoldAStack) {
  std::string text = "gravity = [0, 0, -9.81]\n" + end + "[contact]\nfriction = 0.5\nsweeps = 4\n" +
                     obstacle("shape = 'plane'\nfriction = 0.5\ntranslation = [0, 0, -0.1]\n");
  constexpr int blocks = 10;
  for (int k = 0; k < blocks; ++k) {
    text += body(fmt::format("block {}", k),
                 "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.1\nlattice = 'nodes'\n",
                 fmt::format("translation = [{}, {}, {}]\nrotation = [0, 0, {}]\n", 0.003 * k,
                             -0.002 * k, 0.2 * k, 7 * k),
                 1e7) +  // softer ones buckle under their weight
            "damping = 6\n";
  }
  Way way(text, 4e-4);
  // The tower leans and comes back at 3.3 rad/s, which is damped critically.
  way.solver.step(6500);
  const Vec3d before = way.centre();
  double force = 0;
  for (int k = 0; k < 1000; ++k) {
    way.solver.step();
    if (k % 10 == 0) force += way.contacts()[0].force.z / 100;
  }
  EXPECT_NEAR(force / (9.81 * way.mass()), 1, 1e-3);
  EXPECT_LE(norm(way.centre() - before), 1e-3 * 0.1);
  double deepest = 0;
  for (const ContactReading& c : way.contacts()) deepest = std::max(deepest, c.depth);
  EXPECT_LE(deepest, 0.2 * 0.1);
}

TEST(BodyContacts, HaveTheSameBitsOnAnyThreadsAndAfterARestart) {
  // In double, sums are seen to depend on what else is in lists, which a restart finds anew.
  for (const Precision precision : {Precision::single, Precision::double_}) {
    const std::string text = meeting_balls("[contact]\nfriction = 0.4\n");
    Way one(text, dt, precision, 1), three(text, dt, precision, 3);
    one.solver.step(220);
    three.solver.step(120);
    EXPECT_GT(norm(three.contacts()[0].impulse), 0.1);
    Way resumed(text, dt, precision, 2);
    Solver next(resumed.model, *resumed.backend, three.solver.state(), Method::verlet);
    next.step(100);
    const State expected = one.solver.state(), found = next.state();
    EXPECT_EQ(expected.displacement, found.displacement);
    EXPECT_EQ(expected.velocity, found.velocity);
    EXPECT_EQ(expected.step_sums, found.step_sums);
  }
}

/// Copies of a body share the field of distances of the first one, as it is without them: a later
/// copy changes no bit. An earlier one changes the rounding of places alone, unless it is turned,
/// which turns the nodes of the field.
TEST(BodyContacts, DoNotDependOnCopiesFarAway) {
  const std::string far = "translation = [5, 4, 3]\n", turned = far + "rotation = [10, 20, 30]\n";
  const std::string left = body("left", ball_shape,
                                "translation = [-0.105, 0, 0]\nvelocity = [1, 0, 0]\n"),
                    right = body("right", ball_shape,
                                 "translation = [0.105, 0.05, 0.01]\nvelocity = [-1, 0, 0]\n"),
                    copy = body("copy", ball_shape, far),
                    turned_copy = body("copy", ball_shape, turned);
  const std::string start = end + "[contact]\nfriction = 0.4\n";
  Way alone(start + left + right, dt), later(start + left + right + turned_copy, dt),
      earlier(start + copy + left + right, dt);
  for (Way* way : {&alone, &later, &earlier}) way->solver.step(200);
  EXPECT_GT(norm(alone.contacts()[0].impulse), 0.1);
  const State expected = alone.solver.state(), with_later = later.solver.state(),
              with_earlier = earlier.solver.state();
  const auto copied = static_cast<std::size_t>(earlier.model.parts[0].end);
  double off = 0;
  for (std::size_t i = 0; i < expected.velocity.size(); ++i) {
    EXPECT_EQ(with_later.velocity[i], expected.velocity[i]);
    EXPECT_EQ(with_later.displacement[i], expected.displacement[i]);
    off = std::max(off, norm(with_earlier.velocity[copied + i] - expected.velocity[i]));
  }
  EXPECT_LE(off, 1e-9);  // of 1 m/s
}

/// The states after a step of contact between places. @param found_at where points are found
std::vector<SurfaceState> after_contact(const Model& model, const std::vector<Vec3d>& found_at,
                                        const std::vector<Vec3d>& places) {
  BodyContacts contacts(model, 1);
  const std::vector<Index>& layer = model.body_contact.layer.phyxels;
  const auto number = [&](Index i) {
    return std::lower_bound(layer.begin(), layer.end(), i) - layer.begin();
  };
  std::vector<SurfaceState> states;
  for (std::size_t k = 0; k < layer.size(); ++k) {
    states.push_back({places[k] - model.position[layer[k]], {}});
  }
  contacts.begin_step(dt, [&](Index i) {
    return SurfaceState{found_at[static_cast<std::size_t>(number(i))] - model.position[i], {}};
  });
  const std::int64_t generation = contacts.generation();
  const auto get = [&](Index i) { return states[static_cast<std::size_t>(number(i))]; };
  contacts.begin_step(dt, get);
  EXPECT_EQ(contacts.generation(), generation);
  for (std::size_t p = 0; p < contacts.count(); ++p) contacts.set_gradient(p, {});
  contacts.keep_apart(get, [&](Index i, const SurfaceState& state) {
    states[static_cast<std::size_t>(number(i))] = state;
  });
  return states;
}

TEST(BodyContacts, OfFoldedPartsDoNotDependOnWherePointsWereFound) {
  const Way way(bar_and_cube(1e5), dt);
  std::mt19937 random(5);
  const double most = 0.1 * SurfaceLayer(way.model).least_skin();
  std::uniform_real_distribution<double> shift(-most, most);
  int moved = 0;
  for (int k = 0; k < 20; ++k) {
    std::vector<Vec3d> places = strewn(way.model, random), earlier = places;
    for (Vec3d& x : earlier) x += {shift(random), shift(random), shift(random)};
    const std::vector<SurfaceState> one = after_contact(way.model, places, places),
                                    other = after_contact(way.model, earlier, places);
    for (std::size_t p = 0; p < one.size(); ++p) {
      EXPECT_EQ(one[p].velocity, other[p].velocity) << k << ' ' << p;
      moved += norm(one[p].velocity) > 0;
    }
  }
  EXPECT_GT(moved, 100);
}

/// A cube of 0.1 m, 4 phyxels across, on its faces.
const std::string cube =
    "shape = 'block'\nsize = [0.1, 0.1, 0.1]\nspacing = 0.025\nlattice = 'nodes'\n";

TEST(BodyContacts, OfBodiesAtRestAreFoundWhenAnObstacleSetsThemInMotion) {
  Way way(end + touching +
              obstacle("shape = 'box'\nsize = [0.1, 0.2, 0.2]\ntranslation = [-0.1001, 0, 0]\n"
                       "[obstacle.motion]\nvelocity = [1.5, 0, 0]\n") +
              body("a", cube, "") + body("b", cube, "translation = [0.14, 0, 0]\n"),
          1e-3);
  way.solver.step(150);
  // An elastic impact of an unmovable mass gives a cube of 1 kg twice its speed, which it passes
  // on.
  EXPECT_GT(way.contacts()[2].impulse.x, 2);
  const auto place_of = [&](std::size_t part) {  // along x
    const State state = way.solver.state();
    const Part& p = way.model.parts[part];
    double sum = 0;
    for (Index i = p.begin; i < p.end; ++i)
      sum += way.model.position[i].x + state.displacement[i].x;
    return sum / (p.end - p.begin);
  };
  EXPECT_GT(place_of(1) - place_of(0), 0.09);  // they are 0.1 m wide, and swing
}

TEST(BodyContacts, LeaveBodiesAtRestThatTouch) {
  Way way(end + touching + body("a", cube, "") + body("b", cube, "translation = [0.1, 0, 0]\n"),
          1e-3);
  StabilityWatch watch(way.model, diagnose(way.model, *way.backend, way.solver));
  way.solver.step(200);
  watch.check(diagnose(way.model, *way.backend, way.solver));
  EXPECT_LE(norm(velocity_of(way, 0)), 1e-6);
}

/// A block that lies on another one, phyxels of which are held, or falls on it.
std::string held_block(const std::string& contact, const std::string& held,
                       const std::string& more) {
  return "gravity = [0, 0, -9.81]\n" + end + contact +
         body("lower",
              "shape = 'block'\nsize = [0.3, 0.3, 0.1]\nspacing = 0.05\nlattice = 'nodes'\n",
              "translation = [0, 0, -0.05]\n[[body.fixed]]\n" + held) +
         body("upper",
              "shape = 'block'\nsize = [0.2, 0.2, 0.1]\nspacing = 0.05\nlattice = 'nodes'\n",
              "translation = [0.01, 0, 0.05]\n" + more);
}
const std::string all_held = "all = true\n";

TEST(BodyContacts, AndReactionsMakeAllChangesOfMomentum) {
  for (const std::string& held : {all_held, std::string("box = [[-1, -1, -1], [0.01, 1, 1]]\n")}) {
    for (const std::string method : {"", "method = 'penalty'\n"}) {
      Way way(
          held_block(touching + method + "friction = 0.3\n", held, "velocity = [0.2, 0, -0.3]\n"),
          dt);
      way.solver.step(40);
      EXPECT_GT(way.contacts()[1].force.z, 10);
      const Vec3d before = way.momentum(), weight = way.mass() * way.model.gravity;
      const Vec3d reaction = find_reactions(way.model, *way.backend, way.solver)[0].force;
      way.solver.step();
      const Vec3d missing = (way.momentum() - before) / dt - weight - reaction;
      EXPECT_LE(norm(missing), 1e-9 * norm(weight)) << held << method;  // rounding
    }
  }
}

TEST(BodyContacts, AtRestOnHeldPhyxelsAreBorneByTheirSupports) {
  Way way(held_block("[solver]\nmethod = 'equilibrium'\n" + touching, all_held,
                     "[[body.fixed]]\nall = true\naxes = 'xy'\n"),
          1);
  way.solver.step();
  const double weight = 9.81 * way.mass();
  // The search leaves residual forces of 1e-8 of what acts.
  EXPECT_NEAR(find_reactions(way.model, *way.backend, way.solver)[0].force.z, weight,
              1e-6 * weight);
}

TEST(BodyContacts, AreRefusedToBodiesThatOverlapAtTheStart) {
  const auto refusal = [](const std::string& text) {
    try {
      build_model(parse_scene(text, "scene.toml"));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const std::string shape =
      "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n";
  const std::string message = refusal(end + touching + body("a", shape, "") +
                                      body("b", shape, "translation = [0.17, 0.01, 0]\n"));
  EXPECT_THAT(message, ::testing::HasSubstr("scene.toml:3:1: body \""));
  EXPECT_THAT(message, ::testing::HasSubstr("is 0.03 m deep in body \""));
  EXPECT_THAT(refusal(end + touching + body("a", shape, "") + body("b", shape, "")),
              ::testing::HasSubstr("m deep in body \""));
  // Bodies that touch may.
  EXPECT_EQ(refusal(end + touching + body("a", shape, "") +
                    body("b", shape, "translation = [0.2, 0.01, 0]\n")),
            "accepted");
}

TEST(BodyContacts, OfBodiesThatAreTooFastAreRefusedWithTheCause) {
  Way way(meeting_balls(touching), dt);
  const double waves = pressure_wave_speed(way.model.parts[0].material);
  const auto message_at = [&](double speed) -> std::string {
    try {
      check_contact_speeds(way.model, way.solver, speed,
                           [&] { return std::vector<double>(2, speed); }, {});
    } catch (const DivergedError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message_at(0.5 * waves), "");
  EXPECT_THAT(message_at(50 * waves), ::testing::HasSubstr("might pass through each other"));
  EXPECT_THAT(message_at(1e9 * waves), ::testing::HasSubstr("presses phyxels into each other that "
                                                            "cannot give way"));
}

}  // namespace
}  // namespace phyxel
