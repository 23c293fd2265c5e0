/// Contact with what supports hold, against mechanics: free rigid bodies on held phyxels, obstacles
/// and bodies on phyxels that are held along some axes.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "phyxel/contacts.hpp"
#include "phyxel/error.hpp"
#include "phyxel/reactions.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

constexpr double g = 9.81;

struct Held : Way {
  using Way::Way;
  RigidReading read() { return read_rigid_bodies(model, *backend, solver).at(0); }
  std::vector<Reaction> reactions() { return find_reactions(model, *backend, solver); }
};

/// A flat box of 0.5 kg, four spacings of the phyxels wide. @param height of its lower face
std::string box_at(double height, const std::string& keys = "") {
  return obstacle(
      fmt::format("name = 'box'\nshape = 'box'\nsize = [0.2, 0.2, 0.05]\ndensity = 250\n"
                  "translation = [0.01, 0.02, {}]\n{}",
                  height + 0.025, keys));
}
/// A block whose upper face is at z = 0, 0.6 m long. @param supports of it
std::string anvil(const std::string& supports) {
  return body("anvil",
              "shape = 'block'\nsize = [0.6, 0.4, 0.1]\nspacing = 0.05\nlattice = 'nodes'\n",
              "translation = [0.1, 0, -0.05]\n" + supports);
}
const std::string held = "[[body.fixed]]\nall = true\n";
const std::string down = fmt::format("gravity = [0, 0, -{}]\n", g);

TEST(HeldContacts, StopAFreeBodyThatFallsOnThem) {
  for (const std::string method : {"projected", "penalty"}) {
    Held way(down + end + box_at(0.05, "method = '" + method + "'\n") + anvil(held), 1e-4);
    const double energy = way.energy(), weight = 0.5 * g;
    way.solver.step(4000);
    EXPECT_NEAR(way.read().place.z, 0.025, 1e-9);  // rounding of the sweeps
    EXPECT_LE(norm(way.read().velocity), 1e-9);
    EXPECT_NEAR(way.energy(), energy, 1e-9);  // what the impact takes is counted
    const ContactReading contact = way.contacts().at(0);
    // Sweeps end at 1e-9 of a velocity.
    EXPECT_NEAR(contact.force.z, -weight, 1e-6 * weight);
    EXPECT_NEAR(contact.impact_loss, weight * 0.05, 1e-4 * weight * 0.05);  // steps of 0.1 mm
    EXPECT_NEAR(way.reactions().at(0).force.z, weight + way.mass() * g, 1e-6 * weight);
    // Gravity and the impulse have left it at rest.
    EXPECT_NEAR(contact.impulse.z, -weight * way.solver.time(), 1e-3 * weight * 0.4);
  }
}

/// The box on a plane, and on a held block, moves alike.
TEST(HeldContacts, LetAFreeBodyBounceAndSlideAsOnAPlane) {
  const auto moved = [](const std::string& floor) {
    Held way(down + end +
                 box_at(0.02,
                        "velocity = [0.5, 0, 0]\nfriction = 0.2\n"
                        "restitution = 0.5\n") +
                 floor,
             1e-4);
    std::vector<RigidReading> all;
    for (int k = 0; k < 20; ++k) {
      way.solver.step(100);
      all.push_back(way.read());
    }
    return all;
  };
  const std::string bystander = body("far",
                                     "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.1\n"
                                     "lattice = 'nodes'\n",
                                     "translation = [90, 0, 0]\n" + held);
  const auto on_plane = moved(obstacle("shape = 'plane'\nfriction = 0.2\nrestitution = 0.5\n") +
                              bystander),
             on_held = moved(anvil(held));
  double highest = 0;
  for (std::size_t k = 0; k < on_plane.size(); ++k) {
    // Corners bear it on the plane, phyxels below it on the block.
    EXPECT_LE(norm(on_held[k].place - on_plane[k].place), 1e-3) << k;
    if (k >= 6) highest = std::max(highest, on_held[k].place.z - 0.025);
  }
  EXPECT_NEAR(highest, 0.25 * 0.02, 1e-3);
  EXPECT_LT(on_held.back().velocity.x, 0.45);
  EXPECT_GT(on_held.back().velocity.x, 0.05);
}

TEST(HeldContacts, SlowAFreeBodyThatSlidesByFriction) {
  Held way(down + end + box_at(0, "velocity = [1, 0, 0]\nfriction = 0.3\n") + anvil(held), 1e-4);
  way.solver.step(1000);
  // Its velocity is that of half a step before; the first steps find the sweeps.
  EXPECT_NEAR(way.read().velocity.x, 1 - 0.3 * g * 0.1, 1e-3);
  EXPECT_NEAR(way.reactions().at(0).force.x, -0.3 * 0.5 * g, 1e-3);
  const ContactReading contact = way.contacts().at(0);
  EXPECT_NEAR(contact.friction_heat, 0.25 * (1 - std::pow(1 - 0.03 * g, 2)), 1e-3);
}

TEST(HeldContacts, OfMovedPhyxelsTakeAFreeBodyAlong) {
  const std::string belt = "[[body.motion]]\nall = true\nvelocity = [0.2, 0, 0.1]\n";
  Held way(down + end + box_at(1e-6, "friction = 0.5\n") + anvil(belt), 1e-4);
  way.solver.step(2000);
  EXPECT_LE(norm(way.read().velocity - Vec3d{0.2, 0, 0.1}), 1e-6);
  EXPECT_LE(norm(way.read().spin), 1e-6);
}

TEST(HeldContacts, MustNotBeInAFreeBodyAtTheStart) {
  try {
    Held way(end + box_at(-0.01) + anvil(held), 1e-4);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("body \"anvil\" is 0.01 m deep in obstacle \"box\""));
  }
}

/// A block that is held along x and y lies on a slope of 45 degrees without friction.
std::string on_slope(const std::string& method, const std::string& keys) {
  return "gravity = [0, 0, -1]\n[solver]\nprecision = 'double'\nmethod = '" + method + "'\n" + end +
         obstacle("shape = 'plane'\nnormal = [-1, 0, 1]\n" + keys) +
         "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\n"
         "lattice = 'nodes'\nrotation = [0, -45, 0]\n"
         "translation = [-0.0707106781, 0, 0.0707106782]\n"
         "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\nviscosity = 0.01\n"
         "[[body.fixed]]\nall = true\naxes = 'xy'\n";
}

TEST(HeldContacts, AlongSomeAxesTakeTheirPartOfAnObstaclesForce) {
  for (const auto& [method, keys, steps] : {std::tuple("verlet", "", 8000),
                                            {"verlet", "method = 'penalty'\n", 5000},
                                            {"implicit", "", 30},
                                            {"equilibrium", "", 1}}) {
    SCOPED_TRACE(std::string(method) + keys);
    Held way(on_slope(method, keys), method == std::string("implicit") ? 0.1 : dt);
    way.solver.step(steps);
    const double weight = way.mass();
    const Vec3d force = way.contacts().at(0).force, reaction = way.reactions().at(0).force;
    EXPECT_NEAR(force.x, -force.z, 1e-9 * weight);     // rounding
    EXPECT_NEAR(reaction.x, -force.x, 1e-6 * weight);  // residual forces of searches
    // Along z the obstacle bears the weight. Springs of penalties still swing.
    EXPECT_NEAR(force.z, weight, (keys == std::string() ? 1e-3 : 0.5) * weight);
  }
}

/// Slips are not known before a search for rest, nor is friction.
TEST(HeldContacts, HaveReactionsBeforeASearchForRestWithFriction) {
  Held way(on_slope("equilibrium", "friction = 0.2\n"), dt);
  EXPECT_TRUE(std::isfinite(norm(way.reactions().at(0).force)));
  way.solver.step(1);
  const double weight = way.mass();
  const Vec3d force = way.contacts().at(0).force, reaction = way.reactions().at(0).force;
  EXPECT_NEAR(reaction.x, -force.x, 1e-6 * weight);  // residual forces of searches
  EXPECT_NEAR(force.z, weight, 1e-3 * weight);
}

/// The heat of implicit steps is that of slips which supports impose, too: μ times weight times
/// way.
TEST(HeldContacts, MakeHeatOfImposedSlipsInImplicitSteps) {
  const std::string scene =
      "gravity = [0, 0, -9.81]\n[solver]\nprecision = 'double'\n"
      "method = 'implicit'\n" +
      end;
  const std::string moved = "[[body.motion]]\nall = true\naxes = 'xy'\nvelocity = [0.1, 0, 0]\n";
  const std::string bed =
      "[[body]]\nname = 'bed'\nshape = 'block'\nsize = [0.4, 0.3, 0.1]\n"
      "spacing = 0.05\nlattice = 'nodes'\ntranslation = [0, 0, -0.15]\n"
      "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n"
      "[[body.fixed]]\nall = true\n";
  for (const bool on_body : {false, true}) {
    Held way(scene +
                 (on_body ? "[contact]\nfriction = 0.3\n" + bed
                          : obstacle("shape = 'plane'\nfriction = 0.3\n"
                                     "translation = [0, 0, -0.1]\n")) +
                 block() + moved,
             0.01);
    way.solver.step(20);
    double heat = 0, weight = g * way.mass();
    if (on_body) weight *= 8.0 / 20;  // of the block alone
    for (const ContactReading& reading : way.contacts()) heat += reading.friction_heat;
    // The block comes to rest on what bears it in the first steps.
    EXPECT_NEAR(heat, 0.3 * weight * 0.02, 0.1 * 0.3 * weight * 0.02) << on_body;
  }
}

/// A block that is moved along x, and held along y, slides on a floor that bears it.
TEST(HeldContacts, AlongSomeAxesRubOnObstacles) {
  for (const std::string method : {"", "method = 'penalty'\n"}) {
    Held way(
        down + end +
            obstacle("shape = 'plane'\nfriction = 0.3\ntranslation = [0, 0, -0.1]\n" + method) +
            block() + "[[body.motion]]\nall = true\naxes = 'xy'\nvelocity = [0.02, 0, 0]\n",
        dt);
    way.solver.step(2000);
    const Vec3d before = way.contacts().at(0).impulse;
    way.solver.step(2000);
    const Vec3d mean = way.contacts().at(0).impulse - before;  // of a second
    // Springs of penalties still swing, with Coulomb's law at every instant.
    const double weight = way.mass() * g;
    EXPECT_NEAR(mean.z, weight, 0.05 * weight) << method;
    EXPECT_NEAR(mean.x, -0.3 * mean.z, 1e-2 * weight) << method;
    EXPECT_NEAR(way.reactions().at(0).force.x, -way.contacts().at(0).force.x, 1e-6 * weight);
  }
}

/// A block on a held one. @param upper its velocity or supports
std::string on_anvil(const std::string& method, const std::string& contact,
                     const std::string& lower, const std::string& upper) {
  return down + "[solver]\nprecision = 'double'\nmethod = '" + method + "'\n" + end +
         "[contact]\nfriction = 0.3\n" + contact + anvil(lower) +
         body("upper",
              "shape = 'block'\nsize = [0.2, 0.2, 0.1]\nspacing = 0.05\nlattice = 'nodes'\n",
              "translation = [0.01, 0.01, 0.05]\n" + upper);
}

TEST(HeldContacts, SlowABodyThatSlidesByFriction) {
  for (const std::string method : {"verlet", "implicit"}) {
    const double step = method == "verlet" ? dt : 1e-2;
    Held way(on_anvil(method, "", held, "velocity = [1, 0, 0]\n"), step);
    way.solver.step(std::llround(0.1 / step));
    EXPECT_NEAR(velocity_of(way, 1).x, 1 - 0.3 * g * 0.1, 0.01) << method;  // it swings
  }
}

/// Where supports impose the slip of both, they bear the friction.
TEST(HeldContacts, OfTwoBodiesRubWhereNeitherGivesWay) {
  const std::string driven = "[[body.motion]]\nall = true\naxes = 'xy'\nvelocity = [0.02, 0, 0]\n";
  for (const std::string contact : {"", "method = 'penalty'\n"}) {
    Held way(on_anvil("verlet", contact, held, driven), dt);
    way.solver.step(400);
    Vec3d mean;
    const Vec3d before = way.contacts().at(1).impulse;
    way.solver.step(400);
    mean = (way.contacts().at(1).impulse - before) / 0.2;
    // It still bounces, with Coulomb's law at every instant.
    EXPECT_NEAR(mean.x, -0.3 * mean.z, 0.02 * mean.z) << contact;
    EXPECT_NEAR(mean.z, 4 * g, 0.1 * 4 * g) << contact;
  }
}

/// A fine body is no cause to end a run if nothing touches it.
TEST(HeldContacts, AreTooFastByThePairThatTouches) {
  const auto ball = [](const std::string& name, double spacing, double x) {
    return body(name, fmt::format("shape = 'sphere'\nradius = 0.1\nspacing = {}\n", spacing),
                fmt::format("translation = [{}, 0, 0]\n", x));
  };
  const std::string bodies = ball("fast", 0.05, 0) + ball("slow", 0.05, 1) + ball("fine", 0.02, 2);
  const auto message_at = [&](const std::string& contact, double fast) -> std::string {
    Way way(end + contact + bodies, dt);
    try {
      check_contact_speeds(way.model, way.solver, fast,
                           [&] {
                             return std::vector<double>{fast, 0, 0};
                           },
                           {});
    } catch (const DivergedError& error) {
      return error.what();
    }
    return "";
  };
  // In a step of 0.5 ms and by supports of 0.11 and 0.044 m.
  const std::string pair = "[contact]\n[[contact.pair]]\nfirst = 'fast'\nsecond = 'slow'\n";
  EXPECT_EQ(message_at(pair, 80), "");
  EXPECT_THAT(message_at("[contact]\n", 80), HasSubstr("\"fast\" and \"fine\""));
  EXPECT_THAT(message_at(pair, 200), HasSubstr("\"fast\" and \"slow\""));
}

}  // namespace
}  // namespace phyxel
