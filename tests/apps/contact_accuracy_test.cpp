/// Problems of contact of phyxel accuracy, at resolutions that take seconds.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "support/accuracy.hpp"
#include "support/program.hpp"

namespace phyxel {
namespace {

using app::Discretisation;
using app::Filling;
using app::Solution;
using testing::error_of;

Solution solved(const std::string& name, Discretisation d) {
  d.hourglass = 0.1;
  return testing::solved(name, d);
}

constexpr Discretisation irregular{.jitter = 0.2, .closure = 1e-3};

/// The contact has a radius of 2 and of 3 spacings. A surface at rest is about 0.2 p/E spacings
/// deep in a plane that presses it with p: at 0.1 E and 2 spacings, that is 4% of the approach and
/// 6% of the force, and less with the spacing. A phyxel's stress scatters by that as well.
TEST(ContactAccuracy, APressedBallPushesBackAsFiniteElementsDo) {
  const Solution coarse = solved("hertz", {.across = 20}), fine = solved("hertz", {.across = 30});
  EXPECT_LT(std::abs(error_of(coarse, "force")), 0.06);
  EXPECT_LT(std::abs(error_of(fine, "force")), 0.04);
  EXPECT_LT(error_of(fine, "force"), 0);
  EXPECT_LT(std::abs(error_of(fine, "pressure at the pole")), 0.1);
}

/// The half width of contact is 3 spacings: it is known to a sixth of one, and the force as that of
/// a ball.
TEST(ContactAccuracy, APressedCylinderPushesBack) {
  const Solution nodes = solved("cylinder", {.across = 40});
  const Solution mesh =
      solved("cylinder", {.filling = Filling::mesh, .closure = 1e-3, .across = 40});
  for (const Solution& s : {nodes, mesh}) {
    EXPECT_LT(std::abs(error_of(s, "force")), 0.035);
    EXPECT_LT(std::abs(error_of(s, "half width")), 0.055);
  }
}

/// Euler and Eytelwein's ratio leaves out the stiffness of the strap against bending, of order
/// E (t/R)²/24 beside tensions of E/100, of which a tenth of the strap feels some: below 1%.
TEST(ContactAccuracy, ASlidingStrapHasTensionsAsEulerSays) {
  EXPECT_LT(std::abs(error_of(solved("strap", {.across = 2}), "ratio of tensions")), 0.01);
}

/// Steps need no depth; what is left on nodes (seen: 1.3%) comes from the edge of the contact,
/// which lies between two rows of phyxels. Triangles as wide as a spacing, R/10, cut off R/800 to
/// R/400 of an approach of R/25: 5% to 9% of the force.
TEST(ContactAccuracy, APressedBallPushesBackByStepsAlso) {
  const Solution nodes = solved("hertz-steps", {.across = 20});
  const Solution mesh = solved("hertz-steps", {.filling = Filling::mesh, .across = 20});
  EXPECT_LT(std::abs(error_of(nodes, "force")), 0.025);
  EXPECT_LT(std::abs(error_of(nodes, "force")),
            std::abs(error_of(solved("hertz", {.across = 20}), "force")));
  EXPECT_LT(std::abs(error_of(mesh, "force")), 0.09);
}

/// The outermost half layer, 1/40 of a bar's length, meets the other one as a plastic body: the
/// bars lose up to that part of their energy, and stay together for as long as waves need for a
/// layer or two. The plateau of the force lies between these waves.
TEST(ContactAccuracy, EqualBarsExchangeTheirVelocities) {
  for (const Discretisation& d : {Discretisation{}, irregular}) {
    Discretisation coarse = d, fine = d;
    coarse.across = 4;
    fine.across = 8;
    const Solution a = solved("bars", coarse), b = solved("bars", fine);
    EXPECT_LT(std::abs(error_of(a, "force")), 0.01);
    EXPECT_LT(std::abs(error_of(a, "time of contact")), 0.05);
    EXPECT_GT(error_of(a, "energy"), -1.0 / 40);
    EXPECT_LT(error_of(a, "energy"), 0);
    for (const char* of : {"time of contact", "speed of the second", "energy"}) {
      EXPECT_LT(std::abs(error_of(b, of)), 0.8 * std::abs(error_of(a, of))) << of;
    }
  }
}

/// The layer that touches last, 1/20 of the short bar, gives some of its momentum late, and so the
/// restitution errs by about that part; energy as above.
TEST(ContactAccuracy, ABarStopsAtALongerOne) {
  for (const Discretisation& d :
       {Discretisation{.across = 4},
        Discretisation{.filling = Filling::mesh, .closure = 1e-3, .across = 4}}) {
    const Solution s = solved("unequal-bars", d);
    EXPECT_LT(std::abs(error_of(s, "restitution")), 0.06);
    EXPECT_GT(error_of(s, "energy"), -1.0 / 40);
  }
}

/// The circle of contact has a radius of 1.6 spacings: rows of phyxels begin to carry one by one,
/// which moves time and approach by some percent, less than the 8% that the size of the balls does.
TEST(ContactAccuracy, BallsBounceAsFiniteElementsDo) {
  const Solution s = solved("balls", {.filling = Filling::mesh, .across = 16});
  EXPECT_LT(std::abs(error_of(s, "time of contact")), 0.05);
  EXPECT_LT(std::abs(error_of(s, "approach")), 0.05);
  EXPECT_GT(error_of(s, "restitution"), -0.03);
  EXPECT_LT(error_of(s, "restitution"), 0);
}

/// A ball that rolls on the corners of a polyhedron, a spacing of a sixth of the radius apart,
/// loses some percent of its speed.
TEST(ContactAccuracy, ASlidingBallBeginsToRoll) {
  const Solution s = solved("rolling", {.filling = Filling::mesh, .across = 12});
  EXPECT_LT(std::abs(error_of(s, "speed")), 0.05);
  EXPECT_LT(std::abs(error_of(s, "speed of the surface")), 0.05);
  EXPECT_LT(std::abs(error_of(s, "way")), 0.02);
}

/// The weight compresses the block by up to 10⁻⁴ m, of which 0.3 are missing of the normal
/// impulse, in half a metre.
TEST(ContactAccuracy, ABlockSlidesAsCoulombHasIt) {
  for (const Discretisation& d : {Discretisation{.across = 4}, irregular}) {
    Discretisation small = d;
    small.across = 4;
    EXPECT_LT(std::abs(error_of(solved("slope", small), "way")), 3e-4);
  }
}

/// The mean is the stress of the bulk; corners of both blocks lie on each other, where phyxels have
/// partners on one side alone. Seen: 0.5% and 17%; where depth is recovered in 0.2 times range /
/// wave speed instead of 0.5, 0.4% and 14%, but folds then make twice the energy.
TEST(ContactAccuracy, BlocksPassPressureOn) {
  for (const Discretisation& d : {Discretisation{}, irregular}) {
    Discretisation small = d;
    small.across = 4;
    const Solution s = solved("pressed-blocks", small);
    EXPECT_LT(std::abs(error_of(s, "mean pressure")), 6e-3);
    EXPECT_LT(error_of(s, "root mean square error of the pressure"), 0.1);
    EXPECT_LT(error_of(s, "largest error of the pressure"), 0.5);
    EXPECT_LT(error_of(s, "largest error away from edges"), 0.18);
  }
}

class ContactAccuracyCommand : public test::Program {};

TEST_F(ContactAccuracyCommand, ContactNamesAllItsProblems) {
  const auto some = run({"accuracy", "contact", "--across", "2", "--lattice", "nodes", "--jitter",
                         "0", "--closure", "0", "--factor", "2.2"});
  EXPECT_EQ(some.code, 0) << some.err;
  for (const char* name : {"bars", "unequal-bars", "slope", "pressed-blocks"}) {
    EXPECT_THAT(some.out, ::testing::HasSubstr(std::string("\n") + name + ",")) << name;
  }
  EXPECT_THAT(some.out, ::testing::Not(::testing::HasSubstr("\ntension,")));
}

}  // namespace
}  // namespace phyxel
