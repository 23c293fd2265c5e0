/// Readings of contact: they foresee the next step, which a device tries and takes back.
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>

#include "phyxel/reactions.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

/// A block of metal that is driven down onto another one, which rests on a floor beside a free ball
/// that rolls against it. @param contact keys of [contact]. @param floor keys of the obstacles
std::string pressed(const std::string& contact, const std::string& floor) {
  const auto metal_block = [](const std::string& name, const std::string& at,
                              const std::string& more) {
    return "[[body]]\nname = '" + name +
           "'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n"
           "translation = [" +
           at + "]\n" + more +
           "[body.material]\nlaw = 'j2'\nyield_stress = 800\nyoung = 1e5\npoisson = 0.3\ndensity = "
           "1000\n"
           "viscosity = 0.004\n";
  };
  return "gravity = [0, 0, -9.81]\n" + end + "[contact]\n" + contact +
         obstacle("shape = 'plane'\nname = 'floor'\ntranslation = [0, 0, -0.101]\n" + floor) +
         obstacle(
             "shape = 'sphere'\nname = 'ball'\nradius = 0.05\ntranslation = [0.17, 0, -0.05]\n"
             "density = 500\nvelocity = [-0.8, 0, 0]\n") +
         metal_block("lower", "0, 0, 0", "") +
         metal_block(
             "upper", "0.03, 0.02, 0.2005",
             "[[body.motion]]\nbox = [[-1, -1, 0.3], [1, 1, 0.31]]\nvelocity = [0.1, 0, -1]\n"
             "axes = 'xz'\n");
}

struct Kind {
  const char* name;
  const char* contact;
  const char* floor;
  Precision precision;
};
void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

class NextContacts : public ::testing::TestWithParam<Kind> {
 protected:
  static Way way() {
    const Kind& kind = GetParam();
    return {pressed(kind.contact, kind.floor), dt, kind.precision};
  }
};

TEST_P(NextContacts, AreWhatTheNextStepDoes) {
  Way way = this->way();
  const bool rounds = GetParam().precision != Precision::double_;
  int of_bodies = 0, of_obstacles = 0;
  for (int look = 0; look < 8; ++look) {
    way.solver.step(25);
    const std::vector<ContactReading> now = way.contacts();
    way.solver.step();
    const std::vector<ContactReading> then = way.contacts();
    for (std::size_t o = 0; o < now.size(); ++o) {
      const Vec3d did = then[o].impulse - now[o].impulse, foreseen = dt * now[o].force;
      // In float, a step rounds the momentum of each phyxel, of 0.1 kg at 1 m/s, by 4e-9 N s; the
      // forecast does not. Several phyxels touch the ball at once, at arms of 0.1 m.
      const double relative = rounds ? 1e-3 : 1e-9, rounding = rounds ? 2e-8 : 1e-12;
      EXPECT_LE(norm(did - foreseen), relative * norm(did) + rounding) << now[o].obstacle;
      const Vec3d turned = then[o].angular_impulse - now[o].angular_impulse;
      EXPECT_LE(norm(turned - dt * now[o].torque), relative * norm(turned) + 0.1 * rounding);
      if (norm(did) > 0) ++(now[o].shape == "body" ? of_bodies : of_obstacles);
    }
  }
  EXPECT_GT(of_bodies, 6);
  EXPECT_GT(of_obstacles, 6);
}

TEST_P(NextContacts, LeaveNoTrace) {
  Way looked = this->way(), other = this->way();
  for (int step = 0; step < 120; ++step) {
    looked.contacts();
    find_reactions(looked.model, *looked.backend, looked.solver);
    looked.solver.step();
  }
  other.solver.step(120);
  const State a = looked.solver.state(), b = other.solver.state();
  EXPECT_EQ(a.displacement, b.displacement);
  EXPECT_EQ(a.velocity, b.velocity);
  ASSERT_EQ(a.rigid.size(), 1u);
  EXPECT_EQ(a.rigid[0].numbers(), b.rigid[0].numbers());
  EXPECT_EQ(looked.backend->step_sums(), other.backend->step_sums());
  EXPECT_EQ(a.history, b.history);
  EXPECT_GT(norm(looked.contacts()[0].impulse), 0.1);
}

TEST_P(NextContacts, AreThoseThatTheHostFinds) {
  Way way = this->way();
  const auto host = make_cpu_backend(way.model, Precision::double_, 1);
  way.solver.step(100);
  const State state = way.solver.state();
  host->put(state);
  Solver alike(way.model, *host, state, Method::verlet);
  const std::vector<ContactReading> here = way.contacts(),
                                    there = find_contacts(way.model, *host, alike);
  // Forces in float, of some 10 N in all, are rounded to 1e-7 of stresses of 1 kPa.
  const bool rounds = GetParam().precision != Precision::double_;
  double deepest = 0;
  for (std::size_t o = 0; o < here.size(); ++o) {
    EXPECT_LE(norm(here[o].force - there[o].force),
              (rounds ? 1e-3 : 1e-6) * norm(there[o].force) + 1e-9)
        << here[o].obstacle;
    EXPECT_NEAR(here[o].depth, there[o].depth, 1e-9);
    deepest = std::max(deepest, here[o].shape == "body" ? here[o].depth : 0);
  }
  EXPECT_GT(deepest, 1e-6);
}

TEST(FastBodies, AreSeenByReadingsAndBySteps) {
  // Two slabs slide over each other, by 0.44 of a support in a step.
  constexpr double step = 0.00125;
  const auto slab = [](const char* name, const char* at, const char* velocity) {
    return body(name,
                fmt::format("shape = 'block'\nsize = [0.6, 0.3, 0.15]\nspacing = 0.05\n"
                            "translation = [{}]\nvelocity = [{}]\n",
                            at, velocity),
                "", 1e6);
  };
  Way way(end + "[contact]\n" + slab("a", "-0.2, 0, 0.0753", "19, 0, -0.5") +
              slab("b", "0.2, 0.01, -0.0753", "-19, 0, 0.5"),
          step);
  int touching = 0;
  for (int k = 0; k < 16; ++k) {
    const ContactReading now = way.contacts()[0];
    way.solver.step();
    const Vec3d did = way.contacts()[0].impulse - now.impulse;
    EXPECT_LE(norm(did - step * now.force), 1e-9 * norm(did)) << k;
    touching += norm(did) > 0;
  }
  EXPECT_GT(touching, 10);
}

INSTANTIATE_TEST_SUITE_P(
    All, NextContacts,
    ::testing::Values(Kind{"impulses", "friction = 0.3\nsweeps = 3\n", "friction = 0.2\n",
                           Precision::double_},
                      Kind{"impulses_in_float", "friction = 0.3\n", "", Precision::single},
                      Kind{"impulses_in_mixed", "friction = 0.3\n", "", Precision::mixed},
                      Kind{"penalties", "friction = 0.3\nmethod = 'penalty'\n",
                           "friction = 0.2\nmethod = 'penalty'\n", Precision::double_}),
    [](const auto& kind) { return std::string(kind.param.name); });

}  // namespace
}  // namespace phyxel
