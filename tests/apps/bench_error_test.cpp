/// The tables of `bench error`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/program.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

class BenchError : public test::Program {};

TEST_F(BenchError, HasTheErrorsOfAccuracyBesideTheTimesOfSteps) {
  const test::Outcome bench =
      run({"bench", "error", "gravity", "--across", "5,3,4", "--lattice", "nodes", "--factor",
           "1.8", "--device", "cpu", "--safety", "0.4,0.8", "--seconds", "0.01", "--json"});
  ASSERT_EQ(bench.code, 0) << bench.err;
  const auto rows = nlohmann::json::parse(bench.out)["rows"];
  ASSERT_EQ(rows.size(), 6u);  // two safeties of each cloud, which ascend
  const test::Outcome accuracy =
      run({"accuracy", "gravity", "--across", "3,4,5", "--lattice", "nodes", "--jitter", "0",
           "--hourglass", "0.1", "--closure", "0", "--json"});
  const auto known = nlohmann::json::parse(accuracy.out)["rows"];
  ASSERT_EQ(known.size(), 3u);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto& row = rows[k];
    EXPECT_EQ(row["phyxels"], known[k / 2]["phyxels"]);
    EXPECT_NEAR(row["error"], known[k / 2]["error"], 1e-4);  // of four digits both
    EXPECT_GT(row["rest_seconds"], 0);
    const double steps = 1 / row["time_step_s"].get<double>();
    EXPECT_NEAR(row["seconds_per_simulated_second"], steps * row["step_seconds"].get<double>(),
                2e-3 * row["seconds_per_simulated_second"].get<double>());
  }
  // Steps of half the length take twice as long.
  const double slow = rows[0]["seconds_per_simulated_second"],
               fast = rows[1]["seconds_per_simulated_second"];
  EXPECT_NEAR(slow, 2 * fast, 4e-3 * fast);
}

TEST_F(BenchError, WritesTheFastestSettings) {
  const test::Outcome bench =
      run({"bench", "error", "tension", "--across", "3,4,5", "--lattice", "nodes", "--factor",
           "1.6,1.8", "--device", "cpu", "--seconds", "0.01", "--level", "5", "--fastest",
           "fastest.csv", "--csv", "error.csv"});
  ASSERT_EQ(bench.code, 0) << bench.err;
  // The extension of a bar is exact on lattices: the coarsest cloud serves.
  EXPECT_THAT(test::text_of(folder_ / "fastest.csv"), HasSubstr("\ntension,E,nodes,steps,5,1."));
  EXPECT_THAT(test::text_of(folder_ / "fastest.csv"), HasSubstr(",0.1,0,float,0.8,3,"));
  EXPECT_THAT(test::text_of(folder_ / "fastest.csv"), HasSubstr("\nall,worst,nodes,rest,5,"));
  EXPECT_THAT(test::text_of(folder_ / "error.csv"), HasSubstr("\ntension,ν,nodes,1.8,0.1,0,5,"));
}

TEST_F(BenchError, TakesTheTimesOfAnEarlierTable) {
  const test::Outcome measured =
      run({"bench", "error", "tension", "--across", "3,4", "--lattice", "nodes", "--factor", "1.8",
           "--device", "cpu", "--seconds", "0.01", "--csv", "error.csv", "--fastest", "one.csv"});
  ASSERT_EQ(measured.code, 0) << measured.err;
  const test::Outcome again =
      run({"bench", "error", "--from", "error.csv", "--fastest", "other.csv"});
  ASSERT_EQ(again.code, 0) << again.err;
  const auto rows_of = [&](const char* file) {
    const std::string text = test::text_of(folder_ / file);
    return text.substr(text.find("\nproblem,"));
  };
  EXPECT_EQ(rows_of("one.csv"), rows_of("other.csv"));
  const test::Outcome json = run({"bench", "error", "--from", "error.csv", "--json"});
  ASSERT_EQ(json.code, 0) << json.err;
  const nlohmann::json found = nlohmann::json::parse(json.out);
  EXPECT_EQ(found["rows"][0]["problem"], "all");
  EXPECT_TRUE(found["rows"][0]["seconds"].is_number());
  EXPECT_EQ(run({"bench", "error", "--from", "missing.csv"}).code, 2);
}

TEST_F(BenchError, PrintsOneObjectAsJson) {
  const test::Outcome bench =
      run({"bench", "error", "tension", "--across", "3,4", "--lattice", "nodes", "--factor", "1.8",
           "--device", "cpu", "--seconds", "0.01", "--json", "--fastest", "fastest.csv"});
  ASSERT_EQ(bench.code, 0) << bench.err;
  EXPECT_TRUE(nlohmann::json::parse(bench.out)["rows"][0].contains("rest_seconds"));
  EXPECT_THAT(test::text_of(folder_ / "fastest.csv"), HasSubstr("\ntension,E,nodes,"));
}

TEST_F(BenchError, RefusesUnknownProblems) {
  const test::Outcome bench = run({"bench", "error", "gravty"});
  EXPECT_EQ(bench.code, 2);
  EXPECT_THAT(bench.err,
              HasSubstr("problem gravty: unknown (did you mean \"gravity\"?); allowed: "));
}

}  // namespace
}  // namespace phyxel
