/// The time that a family of discretisations needs to reach an error.
#include "fastest.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace phyxel::app {
namespace {

/// A method of second order whose time grows as the fourth power of the resolution.
std::vector<Measured> second_order(std::vector<int> resolutions, double sign = 1) {
  std::vector<Measured> family;
  for (const int n : resolutions) {
    family.push_back({n, sign * 0.16 / (n * n), 1e-3 * n * n * n * n});
  }
  return family;
}

TEST(LastingErrors, AreThoseOfTheWorstFinerCloud) {
  const std::vector<Measured> family{{4, -0.02, 1}, {6, 0.001, 2}, {8, 0.004, 3}, {12, -0.002, 4}};
  EXPECT_THAT(lasting_errors(family), ::testing::ElementsAre(0.02, 0.004, 0.004, 0.002));
}

TEST(LastingErrors, AreInfiniteWhereAFinerCloudHasNoAnswer) {
  const std::vector<Measured> family{{4, 0.02, 1}, {6, std::nan(""), 2}, {8, 0.01, 3}};
  EXPECT_THAT(lasting_errors(family), ::testing::ElementsAre(HUGE_VAL, HUGE_VAL, 0.01));
}

TEST(Reach, LiesBetweenTwoResolutionsOnThePowerLaw) {
  for (const double sign : {1.0, -1.0}) {
    const auto at = reach(second_order({2, 4, 8, 16, 32}, sign), 0.16 / (5.0 * 5));
    ASSERT_TRUE(at);
    EXPECT_NEAR(at->across, 5, 1e-12);  // rounding
    EXPECT_NEAR(at->seconds, 0.625, 1e-12);
  }
}

TEST(Reach, OfAnErrorThatTheCoarsestCloudHasIsThere) {
  const auto at = reach(second_order({4, 8, 16}), 0.02);
  ASSERT_TRUE(at);
  EXPECT_EQ(at->across, 4);
  EXPECT_EQ(at->seconds, 0.256);
}

TEST(Reach, NeedsAFinerCloudThatShowsTheErrorToLast) {
  EXPECT_FALSE(reach(second_order({4, 8}), 0.003));
  EXPECT_TRUE(reach(second_order({4, 8, 16}), 0.003));
  EXPECT_FALSE(reach(second_order({4, 8, 16}), 1e-6));
  EXPECT_FALSE(reach({}, 0.1));
  // Small by chance at 6: what is finer is worse.
  const std::vector<Measured> crosses{{4, -0.02, 1}, {6, 0.0001, 2}, {8, 0.004, 3}, {12, 0.002, 4}};
  EXPECT_FALSE(reach(crosses, 0.001));
}

}  // namespace
}  // namespace phyxel::app
