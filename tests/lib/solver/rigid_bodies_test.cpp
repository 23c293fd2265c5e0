/// Free rigid bodies against mechanics: tops, bouncing, rolling, slopes, stacks, and impacts on
/// elastic bodies.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "phyxel/checkpoint.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "support/contact_scene.hpp"
#include "support/folder.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

constexpr double degree = std::numbers::pi / 180, g = 9.81;

/// A small body far from everything, without which there is no scene.
std::string bystander() {
  return "[[body]]\nname = 'bystander'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.1\n"
         "lattice = 'nodes'\ntranslation = [100, 0, 100]\n[[body.fixed]]\nall = true\n"
         "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n";
}
std::string scene_of(Vec3d gravity, const std::string& obstacles) {
  return fmt::format("gravity = [{}, {}, {}]\n{}{}{}", gravity.x, gravity.y, gravity.z, end,
                     obstacles, bystander());
}
std::string floor_with(const std::string& keys) {
  return obstacle("name = 'floor'\nshape = 'plane'\n" + keys);
}
std::string ball(const std::string& keys) {
  return obstacle("shape = 'sphere'\nradius = 0.1\ndensity = 1000\n" + keys);
}

struct Rigid : Way {
  using Way::Way;
  RigidReading read(std::size_t k = 0) { return read_rigid_bodies(model, *backend, solver).at(k); }
  Diagnostics look() { return diagnose(model, *backend, solver); }
};

TEST(RigidBodies, HaveTheMassAndInertiaOfTheirShapes) {
  const Rigid way(scene_of({}, obstacle("shape = 'box'\nsize = [1, 2, 3]\ndensity = 10\n"
                                        "translation = [5, 0, 0]\n") +
                                   obstacle("shape = 'capsule'\nradius = 0.5\nlength = 1e-9\n"
                                            "density = 10\ntranslation = [0, 9, 0]\n") +
                                   obstacle("shape = 'cylinder'\nradius = 0.5\nlength = 2\n"
                                            "density = 10\nrotation = [90, 0, 0]\n"
                                            "translation = [0, 0, 9]\n")),
                  dt);
  const RigidMass &box = *way.model.obstacles[0].free, &capsule = *way.model.obstacles[1].free,
                  &cylinder = *way.model.obstacles[2].free;
  EXPECT_DOUBLE_EQ(box.mass, 60);
  EXPECT_EQ(box.centre, (Vec3d{5, 0, 0}));
  EXPECT_DOUBLE_EQ(box.inertia.xx, 60 * (4 + 9) / 12.0);
  EXPECT_DOUBLE_EQ(box.inertia.zz, 60 * (1 + 4) / 12.0);
  const double of_ball = 10 * 4.0 / 3 * std::numbers::pi / 8;
  EXPECT_NEAR(capsule.mass, of_ball, 1e-7);  // length is not zero
  EXPECT_NEAR(capsule.inertia.zz, 0.4 * of_ball * 0.25, 1e-7);
  EXPECT_NEAR(capsule.inertia.xx, 0.4 * of_ball * 0.25, 1e-7);
  const double mass = 10 * std::numbers::pi / 2;
  EXPECT_NEAR(cylinder.inertia.yy, 0.5 * mass * 0.25, 1e-12);  // rounding; its axis is y now
  EXPECT_NEAR(cylinder.inertia.xx, mass * (0.25 / 4 + 4.0 / 12), 1e-12);
}

TEST(RigidBodies, TumbleWithTheirAngularMomentumAndEnergy) {
  // About the middle axis, turning is unstable: the box flips over and over.
  Rigid way(scene_of({}, obstacle("shape = 'box'\nsize = [0.1, 0.2, 0.3]\ndensity = 1000\n"
                                  "spin = [0.1, 5, 0.2]\n")),
            2e-3);
  const Vec3d before = way.look().angular_momentum;
  const double energy = way.look().kinetic_energy;
  double least = 1;
  for (int k = 0; k < 40; ++k) {
    way.solver.step(50);
    // Rounding of 2000 steps: the discrete equation has the integrals of the exact one.
    EXPECT_NEAR(way.look().kinetic_energy, energy, 1e-12 * energy);
    EXPECT_LE(norm(way.look().angular_momentum - before), 1e-12 * norm(before));
    const UnitQuaternion q = way.solver.state().rigid[0].turn;
    least = std::min(least, (identity<double>() + change_by(q))(1, 1));
  }
  EXPECT_LT(least, -0.9);  // its middle axis has looked the other way
}

TEST(RigidBodies, FallAndBounce) {
  Rigid way(
      scene_of({0, 0, -g}, floor_with("restitution = 0.8\n") + ball("translation = [0, 0, 0.6]\n")),
      1e-4);
  const double start = way.energy();
  double highest = 0;
  bool has_hit = false;
  for (int k = 0; k < 700; ++k) {
    way.solver.step(10);
    const RigidReading now = way.read();
    has_hit = has_hit || now.velocity.z > 0.1;
    if (has_hit) highest = std::max(highest, now.place.z - 0.1);
  }
  // 0.5 m high at first; steps of 0.3 mm.
  EXPECT_NEAR(highest, 0.64 * 0.5, 1e-3);
  EXPECT_NEAR(way.energy(), start, 1e-3 * 4.18879 * g * 0.5);
}

TEST(RigidBodies, RestOnASlopeOrSlideDownIt) {
  for (const double angle : {20.0, 30.0}) {
    const Vec3d gravity{g * std::sin(angle * degree), 0, -g * std::cos(angle * degree)};
    Rigid way(
        scene_of(gravity, floor_with("friction = 0.4\n") +
                              obstacle("shape = 'box'\nsize = [0.2, 0.2, 0.1]\nfriction = 0.4\n"
                                       "density = 1000\ntranslation = [0, 0, 0.05]\n")),
        1e-4);
    way.solver.step(5000);
    const double moved = way.read().place.x;
    if (angle < 21.8) {
      EXPECT_LE(std::abs(moved), 1e-9);
    } else {
      const double expected = 0.5 * 0.25 * (gravity.x + 0.4 * gravity.z);
      EXPECT_NEAR(moved, expected, 0.005 * expected);
    }
  }
}

TEST(RigidBodies, BeginToRoll) {
  // v = 5/7 v₀ after 2 v₀ / (7 μ g) = 0.29 s.
  Rigid way(scene_of({0, 0, -g}, floor_with("friction = 0.2\n") +
                                     ball("friction = 0.2\ntranslation = [0, 0, 0.1]\n"
                                          "velocity = [2, 0, 0]\n")),
            1e-4);
  way.solver.step(5000);
  const RigidReading now = way.read();
  EXPECT_NEAR(now.velocity.x, 2 * 5.0 / 7, 1e-4);
  EXPECT_NEAR(now.spin.y, now.velocity.x / 0.1, 1e-2);
}

TEST(RigidBodies, PassOnTheirVelocityAsInACradle) {
  std::string balls;
  for (int k = 0; k < 4; ++k) {
    balls += ball(fmt::format("restitution = 1\ntranslation = [{}, 0, 0]\nvelocity = [{}, 0, 0]\n",
                              0.21 * k, k == 0 ? 1 : 0));
  }
  Rigid way(scene_of({}, balls), 1e-4);
  way.solver.step(1000);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(way.read(k).velocity.x, k == 3 ? 1 : 0, 1e-9) << k;
  }
}

TEST(RigidBodies, AreAsFastAsTheirFastestPoint) {
  const auto speed = [](const std::string& shape) {
    const Rigid way(scene_of({}, obstacle(shape + "density = 10\nspin = [0, 100, 0]\n")), dt);
    const Obstacle& obstacle = way.model.obstacles[0];
    return obstacle.largest_speed(obstacle.placed(obstacle.start));
  };
  EXPECT_NEAR(speed("shape = 'box'\nsize = [0.6, 0.03, 0.03]\n"), 50 * norm(Vec3d{0.6, 0.03, 0.03}),
              1e-12);
  EXPECT_NEAR(speed("shape = 'cylinder'\nradius = 0.05\nlength = 0.1\n"), 5 * std::sqrt(2.0),
              1e-12);
  EXPECT_NEAR(speed("shape = 'capsule'\nradius = 0.05\nlength = 0.1\n"), 10, 1e-12);
  EXPECT_NEAR(speed("shape = 'sphere'\nradius = 0.05\n"), 5, 1e-12);
}

/// Tips are on the surface of a shape, or balls that reach it, and cores on its middle.
TEST(RigidBodies, TouchByTipsOfTheirSurface) {
  const auto expect_tips = [](const auto& shape, double depth) {
    int count = 0;
    shape.for_each_tip([&](Vec3d x, double radius, Vec3d core) {
      EXPECT_NEAR(shape.gap(x).distance, -radius, 1e-15);
      EXPECT_NEAR(shape.gap(core).distance, -depth, 1e-15);
      ++count;
    });
    EXPECT_GT(count, 0);
  };
  expect_tips(BoxObstacle{0.6, 0.03, 0.04}, 0.015);
  expect_tips(BoxObstacle{0.4, 0.4, 0.02}, 0.01);
  expect_tips(CylinderObstacle{0.01, 0.4}, 0.01);
  expect_tips(CapsuleObstacle{0.01, 0.4}, 0.01);
  expect_tips(SphereObstacle{0.1}, 0.1);
}

/// Long sticks fall onto another one that crosses them, off its middle: without restitution, an
/// impact takes energy.
TEST(RigidBodies, MakeNoEnergyWhereSticksCross) {
  for (const std::string shape : {"shape = 'capsule'\nradius = 0.01\nlength = 0.4\n",
                                  "shape = 'cylinder'\nradius = 0.01\nlength = 0.4\n",
                                  "shape = 'box'\nsize = [0.02, 0.02, 0.4]\n"}) {
    for (int k = 0; k < 12; ++k) {
      const double turn = 85 + k, off = 0.012 * k;
      Rigid way(scene_of({}, obstacle(shape + "rotation = [90, 0, 0]\n") +
                                 obstacle(shape + fmt::format("rotation = [0, {}, 0]\n"
                                                              "translation = [{}, {}, 0.05]\n"
                                                              "velocity = [0, 0, -0.2]\n"
                                                              "density = 1000\n",
                                                              turn, off, 0.3 * off))),
                1e-3);
      const double before = way.read().kinetic_energy;
      way.solver.step(400);
      EXPECT_LT(way.read().kinetic_energy, before) << shape << turn << ' ' << off;
    }
  }
}

TEST(RigidBodies, StandInAStack) {
  std::string boxes;
  for (int k = 0; k < 5; ++k) {
    boxes +=
        obstacle(fmt::format("shape = 'box'\nsize = [0.2, 0.2, 0.1]\nfriction = 0.5\n"
                             "density = 1000\ntranslation = [0, 0, {}]\n",
                             0.05 + 0.1 * k));
  }
  Rigid way(scene_of({0, 0, -g}, floor_with("friction = 0.5\n") + boxes), 1e-3);
  way.solver.step(300);
  // Its sweeps end at 1e-9 of a velocity, or after a thousand.
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_NEAR(way.read(k).place.z, 0.05 + 0.1 * static_cast<double>(k), 1e-5) << k;
    EXPECT_LE(norm(way.read(k).rotation), 2e-4) << k;
    EXPECT_LE(std::abs(way.read(k).place.x), 1e-4) << k;
  }
}

/// A heavy ball that meets a free block off its middle, without gravity.
std::string impact(const std::string& more = "") {
  return end +
         obstacle(
             "shape = 'sphere'\nradius = 0.1\ndensity = 5000\nfriction = 0.3\n"
             "translation = [0.02, 0.01, 0.21]\nvelocity = [0.1, 0, -0.5]\n"
             "spin = [0, 3, 0]\n" +
             more) +
         "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\n"
         "lattice = 'nodes'\n[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n";
}

/// Expects that an impact of `impact` has kept both momenta, and the energy.
void expect_impact(Rigid& way, const Diagnostics& start) {
  const Diagnostics now = way.look();
  EXPECT_LT(way.read().velocity.z, -0.2);
  EXPECT_GT(way.momentum().z, -100);
  EXPECT_GT(norm(way.momentum()), 0.5);  // it has been hit
  const double size = norm(start.momentum);
  EXPECT_LE(norm(now.momentum - start.momentum), 1e-12 * size);  // rounding
  EXPECT_LE(norm(now.angular_momentum - start.angular_momentum), 1e-12 * size * 0.2);
  // Of first order in the step: half a step's change of velocity counts at either end.
  EXPECT_NEAR(now.total_energy(), start.total_energy(), 0.01 * start.total_energy());
}

TEST(RigidBodies, KeepBothMomentaInAnImpactOnABody) {
  Rigid way(impact(), 1e-4);
  const Diagnostics start = way.look();
  way.solver.step(1500);
  expect_impact(way, start);
}

/// A penalty's force acts on a free body as it acts on the phyxels.
TEST(RigidBodies, KeepBothMomentaInAnImpactByPenalties) {
  Rigid way(impact("method = 'penalty'\n"), 1e-4);
  const Diagnostics start = way.look();
  way.solver.step(6000);
  ASSERT_EQ(way.contacts().at(0).force, Vec3d{});  // they are apart
  expect_impact(way, start);
}

/// A box on a block on a floor. @param density of the box [kg/m³]
std::string box_on_block(double density, const std::string& keys = "") {
  return fmt::format("gravity = [0, 0, -{}]\n", g) + end +
         floor_with("translation = [0, 0, -0.1]\nfriction = 0.5\n") +
         obstacle(fmt::format("shape = 'box'\nsize = [0.1, 0.1, 0.1]\ndensity = {}\n"
                              "friction = 0.5\ntranslation = [0, 0, 0.15]\n{}",
                              density, keys)) +
         block();
}

TEST(RigidBodies, RestOnABodyWithTheirWeightByPenalties) {
  Rigid way(box_on_block(100, "method = 'penalty'\n"), dt);
  way.solver.step(20000);
  const double weight = 100 * 1e-3 * g;
  // It still swings on its springs, which only the block damps.
  EXPECT_NEAR(way.contacts()[1].force.z, -weight, 0.02 * weight);
  EXPECT_LE(norm(way.read().velocity), 5e-3);
}

TEST(RigidBodies, RestOnABodyWithTheirWeight) {
  Rigid way(box_on_block(2000), dt);
  way.solver.step(20000);
  const double weight = 2000 * 1e-3 * g;
  const std::vector<ContactReading> contacts = way.contacts();
  EXPECT_NEAR(contacts[1].force.z, -weight, 1e-4 * weight);
  EXPECT_NEAR(contacts[0].force.z, weight + way.mass() * g, 1e-4 * weight);
  EXPECT_LE(norm(way.read().velocity), 1e-6);
}

TEST(RigidBodies, GoOnAfterARestartWithTheSameBits) {
  Rigid whole(impact(), 1e-4);
  whole.solver.step(600);  // in contact since step 40
  Rigid first(impact(), 1e-4);
  first.solver.step(300);
  const State middle = first.solver.state();
  ASSERT_EQ(middle.rigid.size(), 1u);
  Rigid second(impact(), 1e-4);
  Solver solver(second.model, *second.backend, middle, Method::verlet);
  solver.step(300);
  const State one = whole.solver.state(), other = solver.state();
  EXPECT_EQ(one.displacement, other.displacement);
  EXPECT_EQ(one.velocity, other.velocity);
  EXPECT_EQ(one.rigid[0].numbers(), other.rigid[0].numbers());
}

class CheckpointsOfRigidBodies : public test::Folder {};

TEST_F(CheckpointsOfRigidBodies, HoldAllNumbers) {
  Rigid way(impact(), 1e-4);
  State state = way.solver.state();
  for (int k = 0; k < 400 && norm(state.rigid[0].impulse) == 0; ++k) {  // until bodies touch
    way.solver.step(1);
    state = way.solver.state();
  }
  const State read = read_checkpoint(write_checkpoint(folder_, state, {})).state;
  ASSERT_EQ(read.rigid.size(), 1u);
  EXPECT_EQ(read.rigid[0].numbers(), state.rigid[0].numbers());
  EXPECT_GT(norm(state.rigid[0].impulse), 0);
}

TEST(RigidBodies, DoTheSameOnAnyNumberOfThreads) {
  Rigid one(impact(), 1e-4, Precision::double_, 1), two(impact(), 1e-4, Precision::double_, 2);
  one.solver.step(500);
  two.solver.step(500);
  EXPECT_EQ(one.solver.state().rigid[0].numbers(), two.solver.state().rigid[0].numbers());
}

TEST(RigidBodies, AreRefusedWhereTheyCannotBe) {
  const auto refused = [](const std::string& keys, const std::string& why) {
    try {
      Rigid way(scene_of({}, obstacle(keys)), dt);
      ADD_FAILURE() << keys;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(why));
    }
  };
  refused("shape = 'plane'\ndensity = 1\n", "no plane, and not hollow");
  refused("shape = 'sphere'\nradius = 1\nhollow = true\ndensity = 1\n", "no plane, and not hollow");
  refused("shape = 'sphere'\nradius = 1\nvelocity = [1, 0, 0]\n", "found without a density");
  refused("shape = 'sphere'\nradius = 1\ndensity = 1\n[obstacle.motion]\nvelocity = [1, 0, 0]\n",
          "found beside obstacle.motion");
  for (const char* method : {"implicit", "equilibrium"}) {
    try {
      Rigid way(
          "[solver]\nprecision = 'double'\nmethod = '" + std::string(method) + "'\n" + impact(),
          dt);
      ADD_FAILURE() << method;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("a free rigid body, found with solver.method"));
    }
  }
}

TEST(RigidBodies, MustNotOverlapAtTheStart) {
  try {
    Rigid way(scene_of({}, floor_with("") + ball("name = 'ball'\ntranslation = [0, 0, 0.09]\n")),
              dt);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("obstacle \"ball\" is 0.01 m deep in obstacle \"floor\""));
  }
}

}  // namespace
}  // namespace phyxel
