/// The time that a family of discretisations needs to reach an error.
#include "fastest.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "phyxel/error.hpp"

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

/// A row of `error_columns` on nodes.
std::vector<std::string> row(const char* problem, const char* factor, int across, double error,
                             const char* precision, double seconds) {
  const std::string time = std::to_string(seconds);
  return {problem,
          "deflection",
          "nodes",
          factor,
          "0.1",
          "0",
          std::to_string(across),
          "1",
          "1",
          std::to_string(error),
          "1",
          time,
          precision,
          *precision ? "0.8" : "",
          "1",
          "1",
          time};
}

TEST(FastestSettings, AreThoseOfEachProblemAndOfTheWorstOfAll) {
  CsvTable table;
  table.columns = error_columns();
  for (const int n : {4, 8, 16}) {
    // Support 1.6 is the better one for the first problem, 1.8 for the second, 1.7 for both.
    const double h = 1.0 / (n * n);
    for (const auto& [factor, one, other, time] :
         {std::tuple("1.6", 0.16, 1.6, 1.0), std::tuple("1.8", 1.6, 0.16, 3.0),
          std::tuple("1.7", 0.8, 0.8, 2.0)}) {
      table.rows.push_back(row("first", factor, n, -one * h, "float", time * n));
      table.rows.push_back(row("second", factor, n, other * h, "float", time * n));
    }
  }
  table.rows.push_back(row("third", "1.6", 4, 1e-9, "", 1));  // no steps; no finer cloud
  const std::vector<double> levels{1.25};
  std::vector<std::vector<std::string>> steps;
  for (const auto& found : fastest_settings(table, levels)) {
    if (found[3] == "steps") steps.push_back(found);
  }
  ASSERT_EQ(steps.size(), 3u);
  // At 4 across alone, the third problem counts among all: no finer cloud shows that to last.
  for (const auto& found : fastest_settings(table, std::vector<double>{10})) {
    EXPECT_FALSE(found[0] == "all" && found[3] == "rest" && found[5] == "1.6");
  }
  const auto is = [](const char* problem, const char* factor, const char* across,
                     const char* seconds) {
    return std::vector<std::string>{problem, *problem == 'a' ? "worst" : "deflection",
                                    "nodes", "steps",
                                    "1.25",  factor,
                                    "0.1",   "0",
                                    "float", "0.8",
                                    across,  seconds};
  };
  EXPECT_EQ(steps[0], is("all", "1.7", "8", "16"));
  EXPECT_EQ(steps[1], is("first", "1.6", "4", "4"));
  EXPECT_EQ(steps[2], is("second", "1.8", "4", "12"));
}

TEST(FastestSettings, NeedTheColumnsOfTheTable) {
  CsvTable table;
  table.columns = {"problem"};
  table.rows = {{"gravity"}};
  EXPECT_THROW(fastest_settings(table, std::vector<double>{1}), InputError);
}

}  // namespace
}  // namespace phyxel::app
