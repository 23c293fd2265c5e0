/// The table of `bench sample`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/program.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

class BenchSample : public test::Program {};

TEST_F(BenchSample, TellsTheTimeOfEachStageAndTheQualityOfTheCloud) {
  write("ok.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const test::Outcome bench = run({"bench", "sample", "ok.obj", "--phyxels", "50,2000", "--threads",
                                   "1", "--relaxations", "3", "--json"});
  ASSERT_EQ(bench.code, 0) << bench.err;
  const auto rows = nlohmann::json::parse(bench.out)["rows"];
  ASSERT_EQ(rows.size(), 2u);
  for (const auto& row : rows) {
    double stages = 0;
    for (const char* stage :
         {"inspect_s", "fill_s", "surface_s", "place_s", "relax_s", "volumes_s"}) {
      EXPECT_GT(row[stage], 0) << stage;
      stages += row[stage].get<double>();
    }
    EXPECT_LE(stages, 1.01 * row["seconds"].get<double>());  // rounded to four digits
    EXPECT_LT(row["on_surface"], row["phyxels"]);
    EXPECT_GT(row["smallest_gap"], 0.3);
    EXPECT_LT(row["smallest_gap"], 1);
    EXPECT_GT(row["volume_spread"], 0.1);  // halves and eighths at the surface
  }
  EXPECT_GT(rows[1]["on_surface"], 0);
  EXPECT_THAT(run({"bench", "sample", "missing.obj"}).err, HasSubstr("missing.obj: no such file"));
}

}  // namespace
}  // namespace phyxel
