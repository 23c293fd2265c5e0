/// Reactions in the output of a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "phyxel/checkpoint.hpp"
#include "support/beam_program.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;
using ::testing::Not;

class ReactionsOfRuns : public test::BeamProgram {
 protected:
  /// A beam that is fixed at one end and shaken at the other.
  void write_shaken_beam(const std::string& end) const {
    write_beam(end);
    write("beam.toml", text_of(folder_ / "beam.toml") +
                           "[[body.motion]]\nregion = \"x+\"\namplitude = [0.0, 0.0, 0.02]\n"
                           "frequency = 7\nrotation = [30, 0, 0]\nduration = 0.1\n");
  }
};

TEST_F(ReactionsOfRuns, AreWrittenBesideTheEnergiesAndSummedUp) {
  write_shaken_beam("0.1");
  const Outcome printed = run({"run", "beam.toml"});
  ASSERT_EQ(printed.code, 0) << printed.err;
  EXPECT_THAT(printed.out, HasSubstr("reaction    beam, fixed 1: force ("));
  EXPECT_THAT(printed.out, HasSubstr("reaction    beam, motion 1: force ("));
  EXPECT_THAT(printed.out, HasSubstr("reactions.csv"));
  const std::string log = text_of(folder_ / "out" / "reactions.csv");
  EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 1 + 6 * 2);  // 6 frames of 2 sets

  const Outcome summed = run({"run", "beam.toml", "--force", "--json"});
  ASSERT_EQ(summed.code, 0) << summed.err;
  const auto reactions = nlohmann::json::parse(summed.out)["reactions"];
  ASSERT_EQ(reactions.size(), 2u);
  EXPECT_EQ(reactions[0]["work_j"], 0.0);
  EXPECT_EQ(reactions[1]["body"], "beam");
  EXPECT_EQ(reactions[1]["set"], "motion 1");
  // The last line of the log is the last set of the last frame.
  std::ostringstream force;
  force.precision(17);
  force << reactions[1]["force_n"][0].get<double>();
  EXPECT_THAT(log.substr(log.rfind("motion 1")), HasSubstr(force.str()));

  const Outcome rest = run({"run", "beam.toml", "--force", "--json", "--method", "equilibrium",
                            "--precision", "double"});
  EXPECT_EQ(rest.code, 2);  // a motion with an amplitude never ends
  replace_in_beam("amplitude = [0.0, 0.0, 0.02]\nfrequency = 7\n", "");
  const Outcome found = run({"run", "beam.toml", "--force", "--json", "--method", "equilibrium",
                             "--precision", "double"});
  ASSERT_EQ(found.code, 0) << found.err;
  EXPECT_TRUE(nlohmann::json::parse(found.out)["reactions"][1]["work_j"].is_null());
}

TEST_F(ReactionsOfRuns, AreNotWrittenForFreeBodies) {
  write_beam("0.02");
  replace_in_beam("[[body.fixed]]\nregion = \"x-\"\n", "");
  const Outcome outcome = run({"run", "beam.toml"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, Not(HasSubstr("reaction")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "reactions.csv"));
}

TEST_F(ReactionsOfRuns, AreTheSameBytesAfterAStopAndAResumedRun) {
  for (const std::string precision : {"float", "double", "mixed"}) {
    write_shaken_beam("1.5");
    const std::string whole = "whole_" + precision, parts = "parts_" + precision;
    ASSERT_EQ(run({"run", "beam.toml", "--out", whole, "--precision", precision}).code, 0);
    ASSERT_EQ(interrupted({"run", "beam.toml", "--out", parts, "--precision", precision},
                          parts + "/phyxels_000003.hdf", SIGTERM)
                  .code,
              75);
    const auto middle = latest_checkpoint(folder_ / parts);
    ASSERT_TRUE(middle.has_value());
    EXPECT_FALSE(read_checkpoint(*middle).state.step_sums.empty());
    ASSERT_EQ(
        run({"run", "beam.toml", "--out", parts, "--precision", precision, "--resume", "auto"})
            .code,
        0);
    EXPECT_EQ(text_of(folder_ / whole / "reactions.csv"),
              text_of(folder_ / parts / "reactions.csv"));
  }
}

}  // namespace
}  // namespace phyxel
