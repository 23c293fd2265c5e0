/// Friction in implicit steps and at rest against Coulomb's law.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/reactions.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

constexpr double g = 9.81;

std::string solver_of(const std::string& method) {
  return "[solver]\nmethod = '" + method + "'\nprecision = 'double'\n" + end;
}

/// The block of 8 kg on a plane, with gravity as on a slope.
std::string slope(const std::string& method, double tangent, const std::string& of_plane,
                  const std::string& of_block = "", const std::string& of_material = "") {
  const double angle = std::atan(tangent);
  std::string text =
      fmt::format("gravity = [{}, 0, {}]\n", g * std::sin(angle), -g * std::cos(angle)) +
      solver_of(method) + obstacle("shape = 'plane'\ntranslation = [0, 0, -0.1]\n" + of_plane) +
      block(of_block);
  text.replace(text.find("density = 1000"), 14, "density = 1000\n" + of_material);
  return text;
}

/// The two stages of an implicit step are 1 - √½ of it long.
double stage_of(double step) { return (1 - std::sqrt(0.5)) * step; }

TEST(FrictionOfImplicitSteps, HoldsABlockBelowTheAngleOfFriction) {
  constexpr double step = 0.01;
  Way way(slope("implicit", 0.4, "friction = 0.5\n", "", "damping = 20"), step);
  way.solver.step(100);  // its swinging ends
  const double before = way.centre().x;
  const ContactReading start = way.contacts()[0];
  way.solver.step(50);
  const ContactReading after = way.contacts()[0];
  const Vec3d weight = way.mass() * way.model.gravity;
  EXPECT_LE(norm(after.force + weight), 1e-3 * norm(weight));
  // A slip of at most a thousandth of the depth in each stage, and a tenth of that for the rest of
  // its swinging.
  const double creep = way.centre().x - before;
  EXPECT_GT(after.depth, 0);
  EXPECT_LE(std::abs(creep), 1.1e-3 * after.depth * 50 * step / stage_of(step));
  EXPECT_GT(after.friction_heat, start.friction_heat);
}

TEST(FrictionOfImplicitSteps, LetsABlockSlideAboveTheAngleOfFriction) {
  // So stiff that its swinging, as gravity begins to act, does not count.
  std::string text = slope("implicit", std::tan(M_PI / 6), "friction = 0.3\n");
  text.replace(text.find("young = 1e5"), 11, "young = 1e7");
  Way way(text, 5e-3);
  way.solver.step(80);
  const double acceleration = g * (0.5 - 0.3 * std::cos(M_PI / 6)), t = 0.4;
  const double way_of_it = 0.5 * acceleration * t * t;
  EXPECT_NEAR(way.centre().x, way_of_it, 5e-3 * way_of_it);
  const ContactReading contact = way.contacts()[0];
  // Some points creep as it lands.
  EXPECT_NEAR(contact.impulse.x, -0.3 * contact.impulse.z, 1e-3 * contact.impulse.z);
}

TEST(FrictionOfImplicitSteps, IsFoundWhereStiffBlocksLandInLongSteps) {
  for (const std::string young : {"1e6", "1e7", "1e8"}) {
    std::string text = slope("implicit", 0.3, "friction = 0.5\n",
                             "translation = [0, 0, 0.02]\nvelocity = [0.5, 0, -0.5]\n");
    text.replace(text.find("young = 1e5"), 11, "young = " + young);
    Way way(text, 0.01);
    const auto whole = [&] {  // with the energies of gravity and heat
      return way.energy() + way.contacts()[0].friction_heat -
             way.mass() * dot(way.model.gravity, way.centre());
    };
    const double start = whole();  // what the penalty stores meanwhile is not in it
    for (int k = 0; k < 30; ++k) {
      way.solver.step();
      // Residuals of 1e-8 of the forces act over millimetres.
      EXPECT_LE(whole(), (1 + 1e-5) * start) << young << ' ' << k;
    }
    const ContactReading contact = way.contacts()[0];
    EXPECT_GT(contact.friction_heat, 0.05);
    EXPECT_GT(contact.impulse.z, 0);
    EXPECT_LE(std::abs(contact.impulse.x), 0.5 * contact.impulse.z);
  }
}

TEST(FrictionOfImplicitSteps, IsWholeWherePointsBeginToPressLate) {
  // Poisson's effect lifts the middle of the lower face off at first: its points press after normal
  // forces are held.
  std::string text = slope("implicit", std::tan(40 * M_PI / 180), "friction = 0.5\n");
  text.replace(text.find("young = 1e5"), 11, "young = 1e9");
  text.replace(text.find("poisson = 0.3"), 13, "poisson = 0.45");
  Way way(text, 0.01);
  way.solver.step(20);
  const double angle = 40 * M_PI / 180, t = 0.2;
  const double expected = g * (std::sin(angle) - 0.5 * std::cos(angle)) * t;
  const double speed = way.momentum().x / way.mass();
  EXPECT_NEAR(speed, expected, 1e-3 * expected);
  const ContactReading contact = way.contacts()[0];
  EXPECT_NEAR(contact.impulse.x, -0.5 * contact.impulse.z, 1e-3 * contact.impulse.z);
}

TEST(FrictionOfImplicitSteps, IsTheKineticOneOfWhatSlides) {
  const auto acceleration_of = [](double speed, double friction) {
    Way way(
        slope("implicit", 0.25, fmt::format("friction = {}\nkinetic_friction = 0.2\n", friction),
              fmt::format("velocity = [{}, 0, 0]\n", speed)),
        5e-3);
    way.solver.step(60);
    const double before = way.momentum().x;
    way.solver.step(60);
    return (way.momentum().x - before) / way.mass() / 0.3;
  };
  const double angle = std::atan(0.25);
  const double expected = g * (std::sin(angle) - 0.2 * std::cos(angle));
  // The rest of its swinging, which starts with the whole weight.
  EXPECT_NEAR(acceleration_of(1, 0.4), expected, 0.03 * expected);
  // It holds one that rests, which begins to touch with less than its weight; it rocks still.
  EXPECT_NEAR(acceleration_of(0, 0.7), 0, 0.3 * expected);
}

TEST(FrictionOfImplicitSteps, TurnsEnergyIntoItsHeat) {
  Way way(slope("implicit", std::tan(M_PI / 6), "friction = 0.3\n", "velocity = [1, 0, 0]\n"),
          5e-3);
  const double start = way.energy();
  way.solver.step(60);
  const double heat = way.contacts()[0].friction_heat;
  EXPECT_GT(heat, 5);
  EXPECT_LE(way.energy(), start * (1 + 1e-9));
  // What viscosity and the method take from its swinging (seen: 1e-3 of the heat).
  EXPECT_GE(way.energy(), start - 0.01 * heat);
}

TEST(FrictionOfImplicitSteps, CarriesABlockOnAMovingPlane) {
  // A plane that moves at 0.5 m/s takes the block with it: work = kinetic energy + heat.
  std::string text =
      slope("implicit", 0, "friction = 0.4\n[obstacle.motion]\nvelocity = [0.5, 0, 0]\n");
  text.replace(text.find("young = 1e5"), 11, "young = 1e7");
  Way way(text, 5e-3);
  way.solver.step(60);
  EXPECT_NEAR(way.momentum().x / way.mass(), 0.5, 1e-3 * 0.5);
  const ContactReading contact = way.contacts()[0];
  const double kinetic = 0.5 * 8 * 0.25;
  // The slip of a rigid block ends after v/(µ g), and its heat is that of a half of the work.
  EXPECT_NEAR(contact.friction_heat, kinetic, 0.02 * kinetic);
  EXPECT_NEAR(contact.work, 2 * kinetic, 0.02 * kinetic);
}

TEST(FrictionAtRest, IsThePullUpToItsLimit) {
  for (const double share : {0.3, 0.95}) {
    Way way(slope("equilibrium", share * 0.5, "friction = 0.5\n"), 1);
    way.solver.step();
    const Vec3d weight = way.mass() * way.model.gravity;
    EXPECT_LE(norm(way.contacts()[0].force + weight), 1e-6 * norm(weight)) << share;
  }
  Way slides(slope("equilibrium", 0.55, "friction = 0.5\n"), 1);
  try {
    slides.solver.step();
    FAIL() << "found rest";
  } catch (const DivergedError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("or it slides: friction holds no more than its coefficient times what "
                          "presses"));
  }
}

TEST(FrictionAtRest, HoldsABlockOnAnotherOne) {
  const std::string shape = "shape = 'block'\nsize = [0.2, 0.2, 0.2]\nlattice = 'nodes'\n";
  Way way(fmt::format("gravity = [{}, 0, {}]\n", 0.35 * g, -g) + solver_of("equilibrium") +
              "[contact]\nfriction = 0.5\n" +
              body("lower", shape + "spacing = 0.05\n", "[[body.fixed]]\nregion = 'z-'\n", 1e6) +
              body("upper", shape + "spacing = 0.04\ntranslation = [0, 0, 0.2]\n", "", 1e6),
          1);
  // Before the search slips are not known, and a reading gives what it can.
  ASSERT_EQ(find_reactions(way.model, *way.backend, way.solver).size(), 1u);
  way.solver.step();
  const std::vector<ContactReading> contacts = way.contacts();
  const Vec3d weight = 8.0 * way.model.gravity;
  EXPECT_LE(norm(contacts[1].force + weight), 1e-6 * norm(weight));
  EXPECT_LE(norm(contacts[0].force + contacts[1].force), 1e-12 * norm(weight));
  const std::vector<Reaction> reactions = find_reactions(way.model, *way.backend, way.solver);
  EXPECT_LE(norm(reactions[0].force + way.mass() * way.model.gravity), 1e-6 * norm(weight));
}

TEST(FrictionAtRest, OfPlatesShearsABlock) {
  // Rough plates press a block without Poisson's effect by 1%, and the upper one moves by half of
  // that. Above the limit all points slide.
  const auto sheared = [](double friction) {
    std::string text =
        solver_of("equilibrium") +
        obstacle(
            fmt::format("shape = 'plane'\ntranslation = [0, 0, -0.1]\nfriction = {}\n", friction)) +
        obstacle(fmt::format(
            "shape = 'plane'\nnormal = [0, 0, -1]\ntranslation = [0, 0, 0.1]\nfriction = "
            "{}\n[obstacle.motion]\ndisplacement = [0.001, 0, -0.002]\nduration = 1\n",
            friction)) +
        block();
    text.replace(text.find("poisson = 0.3"), 13, "poisson = 0");
    Way way(text, 1);
    way.solver.step();
    const std::vector<ContactReading> contacts = way.contacts();
    EXPECT_LE(norm(contacts[0].force + contacts[1].force), 1e-5 * norm(contacts[0].force));
    return contacts[1].force;
  };
  // A beam as thick as it is long, clamped at both ends, bends, too: δ = F h (1/E + 1.2/G)/A, with
  // G = E/2 (seen: 9% softer, by penalties and by edges that lift).
  const double stiff = 1e5 * 0.04 * 0.005 / (1 + 1.2 * 2);
  const Vec3d sticks = sheared(2), slides = sheared(0.02);
  EXPECT_NEAR(sticks.x, stiff, 0.15 * stiff);
  EXPECT_NEAR(slides.x, -0.02 * slides.z, 1e-4 * slides.x);  // nearly all points slide along x
}

}  // namespace
}  // namespace phyxel
