/// Probes in the output of a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "phyxel/checkpoint.hpp"
#include "support/beam_program.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;

class ProbesOfRuns : public test::BeamProgram {
 protected:
  void write_probed_beam(const std::string& end) const {
    write_beam(end);
    write("beam.toml", text_of(folder_ / "beam.toml") +
                           "[[probe]]\nname = \"tip, lower\"\npoint = [0.6, 0, 0]\n"
                           "[[probe]]\nname = \"axis\"\nfrom = [0, 0, 0]\nto = [0.6, 0, 0]\n"
                           "points = 3\n[[probe]]\nregion = \"x+\"\n");
  }
};

TEST_F(ProbesOfRuns, AreWrittenBesideTheEnergiesAndSummedUp) {
  write_probed_beam("0.1");
  const Outcome printed = run({"run", "beam.toml"});
  ASSERT_EQ(printed.code, 0) << printed.err;
  EXPECT_THAT(printed.out, HasSubstr("probe       tip, lower: displacement ("));
  EXPECT_THAT(printed.out, HasSubstr("probe       axis, point 3: displacement ("));
  const std::string log = text_of(folder_ / "out" / "probes.csv");
  EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 1 + 6 * 5);  // 6 frames of 5 readings
  EXPECT_THAT(log, HasSubstr("\n0,0,\"tip, lower\",1,0.5999"));

  const Outcome summed = run({"run", "beam.toml", "--force", "--json"});
  ASSERT_EQ(summed.code, 0) << summed.err;
  const auto probes = nlohmann::json::parse(summed.out)["probes"];
  ASSERT_EQ(probes.size(), 5u);
  EXPECT_EQ(probes[3]["probe"], "axis");
  EXPECT_EQ(probes[3]["point"], 3);
  EXPECT_EQ(probes[3]["displacement_m"], probes[0]["displacement_m"]);
  EXPECT_LT(probes[0]["displacement_m"][2].get<double>(), -1e-4);  // it falls
  EXPECT_EQ(probes[4]["probe"], "probe 3");

  const Outcome outside = run({"run", "beam.toml", "--force", "--dry-run"});
  EXPECT_EQ(outside.code, 0) << outside.err;
  replace_in_beam("point = [0.6, 0, 0]", "point = [9, 0, 0]");
  const Outcome refused = run({"run", "beam.toml", "--force"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("beam.toml:"));
  EXPECT_THAT(refused.err, HasSubstr("point [9, 0, 0]"));
  EXPECT_EQ(text_of(folder_ / "out" / "probes.csv"), log);  // nothing is replaced
}

/// A run that stops and goes on has the lines of one that does not.
TEST_F(ProbesOfRuns, ContinueWithARun) {
  write_probed_beam("1.5");
  ASSERT_EQ(run({"run", "beam.toml", "--out", "whole"}).code, 0);
  ASSERT_EQ(
      interrupted({"run", "beam.toml", "--out", "parts"}, "parts/phyxels_000003.hdf", SIGTERM).code,
      75);
  const Outcome rest = run({"run", "beam.toml", "--out", "parts", "--resume", "auto"});
  ASSERT_EQ(rest.code, 0) << rest.err;
  EXPECT_EQ(text_of(folder_ / "whole" / "probes.csv"), text_of(folder_ / "parts" / "probes.csv"));
}

/// Readings do not depend on the fields of frames, but on the recovery of gradients.
TEST_F(ProbesOfRuns, AreRecoveredWhateverFramesHold) {
  write_probed_beam("0.1");
  const auto log_with = [&](const std::string& keys) {
    replace_in_beam("[output]\n", "[output]\n" + keys);
    EXPECT_EQ(run({"run", "beam.toml", "--force"}).code, 0);
    replace_in_beam("[output]\n" + keys, "[output]\n");
    return text_of(folder_ / "out" / "probes.csv");
  };
  const std::string plain = log_with("");
  EXPECT_TRUE(plain == log_with("fields = [\"displacement\", \"stress\"]\n"));
  EXPECT_FALSE(plain == log_with("recovery = false\n"));
}

TEST_F(ProbesOfRuns, WithoutProbesThereIsNoFile) {
  write_beam("0.02");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "probes.csv"));
}

}  // namespace
}  // namespace phyxel
