/// The problems of phyxel accuracy, at resolutions that take one or two seconds.
#include "accuracy/accuracy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <map>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "accuracy/hard_cases.hpp"
#include "device.hpp"
#include "device_option.hpp"
#include "support/program.hpp"

namespace phyxel {
namespace app {
/// Names of parametrised tests.
void PrintTo(const HardCase& hard, std::ostream* out) { *out << hard.name; }
}  // namespace app
namespace {

using app::AccuracyCase;
using app::Discretisation;
using app::Solution;
using ::testing::HasSubstr;

const AccuracyCase& named(const std::string& name) {
  static const std::vector<AccuracyCase> cases = app::accuracy_cases();
  for (const AccuracyCase& c : cases) {
    if (c.name == name) return c;
  }
  throw std::runtime_error(name);
}

Solution solved(const std::string& name, int across) {
  return named(name).solve({.hourglass = 0.3, .across = across});
}

/// Forces of a rotated body are rounding errors of its strains, 10⁻¹⁶, times the condition number
/// of its moments, also for irregular clouds.
TEST(Accuracy, ATurnedBodyHasNoForces) {
  for (const double jitter : {0.0, 0.3}) {
    const Solution s = named("rotation").solve({.jitter = jitter, .hourglass = 0.3, .across = 5});
    EXPECT_LT(s.found.at(0).value, 1e-14);
    EXPECT_EQ(s.phyxels, 216);
  }
}

/// Errors seen: 1.8e-4 and 4e-5.
TEST(Accuracy, TensionGivesTheMaterialBack) {
  const Solution s = solved("tension", 4);
  EXPECT_EQ(s.found.at(0).name, "E");
  EXPECT_NEAR(s.found.at(0).value, s.found.at(0).reference, 5e-4 * s.found.at(0).reference);
  EXPECT_NEAR(s.found.at(1).value, s.found.at(1).reference, 5e-4 * s.found.at(1).reference);
}

/// The error of nodes is half a percent of the finite elements' answer with 1,519 phyxels, that of
/// cells 16%.
TEST(Accuracy, NodesBendAsFiniteElementsDo) {
  for (const char* name : {"gravity", "shear"}) {
    const Solution nodes = solved(name, 6);
    EXPECT_LT(std::abs(nodes.found.at(0).error()), 0.006) << name;
    const Solution cells = named(name).solve({.filling = app::Filling::cells, .across = 6});
    EXPECT_GT(std::abs(cells.found.at(0).error()), 0.1) << name;
  }
}

/// Errors with 1,519 jittered phyxels: 13% too soft without closed gradients, 1.9% with them. The
/// patch test, in which only outer phyxels are prescribed, is exact within the tolerance of
/// Newton's method.
TEST(Accuracy, ClosedGradientsServeIrregularClouds) {
  const Discretisation plain{.jitter = 0.2, .hourglass = 0.1, .across = 6};
  Discretisation closed = plain;
  closed.closure = 1e-3;
  EXPECT_GT(named("gravity").solve(plain).found.at(0).error(), 0.1);
  EXPECT_LT(std::abs(named("gravity").solve(closed).found.at(0).error()), 0.03);
  EXPECT_GT(std::abs(named("tension").solve(plain).found.at(0).error()), 0.1);
  EXPECT_LT(std::abs(named("tension").solve(closed).found.at(0).error()), 0.01);
  closed.closure = 1e-11;
  EXPECT_GT(named("patch").solve(plain).found.at(0).value, 0.1);
  EXPECT_LT(named("patch").solve(closed).found.at(0).value, 1e-8);
}

/// Errors with 1,519 phyxels on and in the bar's surface: 4.5% and 4.4% without, 0.25% and 0.7%
/// with hourglass control and closed gradients.
TEST(Accuracy, MeshesOfPhyxelsBendAsFiniteElementsDo) {
  const Discretisation plain{.filling = app::Filling::mesh, .across = 6};
  Discretisation better = plain;
  better.hourglass = 0.1;
  better.closure = 1e-3;
  for (const char* name : {"gravity", "tension"}) {
    EXPECT_GT(std::abs(named(name).solve(plain).found.at(0).error()), 0.01) << name;
    EXPECT_LT(std::abs(named(name).solve(better).found.at(0).error()), 0.01) << name;
  }
}

/// Energies of a quarter and a half turn, with 525 and 1,519 phyxels.
TEST(Accuracy, ColumnsTwistAsFiniteElementsDo) {
  double before = 0;
  for (const int across : {4, 6}) {
    const Solution s = named("twist").solve({.hourglass = 0.1, .across = across});
    for (const app::Quantity& q : s.found) EXPECT_LT(std::abs(q.error()), 0.1) << q.name;
    const double error = std::abs(s.found.at(1).error());
    if (before > 0) {
      EXPECT_LT(error, before);
    }
    before = error;
  }
}

/// Frequencies with 525 phyxels; torsion, whose shear changes sign, has only four cells across.
TEST(Accuracy, BarsRingAsFiniteElementsDo) {
  const std::pair<const char*, double> seen[] = {
      {"bending", 0.0078}, {"torsion", 0.0601}, {"stretching", 0.000251}};
  for (const auto& [name, error] : seen) {
    const Solution s = solved(name, 4);
    EXPECT_NEAR(std::abs(s.found.at(0).error()), error, 0.1 * error) << name;
    EXPECT_GT(s.evaluations, 500) << name;
  }
}

class AccuracyCommand : public test::Program {};

TEST_F(AccuracyCommand, PrintsATableAndWritesIt) {
  const auto all = run({"accuracy", "rotation", "--across", "4", "--lattice", "nodes", "--jitter",
                        "0", "--hourglass", "0.1", "--csv", "a.csv"});
  EXPECT_EQ(all.code, 0) << all.err;
  EXPECT_THAT(all.out, HasSubstr("case,quantity,lattice"));
  EXPECT_THAT(all.out, HasSubstr("rotation,mean force"));
  EXPECT_EQ(test::text_of(folder_ / "a.csv"), all.out);
  EXPECT_EQ(run({"accuracy", "rotation", "--csv", "a.csv"}).code, 2);  // not without --force
}

TEST_F(AccuracyCommand, HardCasesAreAnsweredOrRefused) {
  const auto hard = run({"accuracy", "hard", "step 1.01", "lone phyxel", "--precision", "float"});
  EXPECT_EQ(hard.code, 0) << hard.err;
  EXPECT_THAT(hard.out, HasSubstr("step 1.01,float,refusal,refusal"));
}

/// Each hard case is answered within its tolerance, or refused as it must be. Cases that take
/// minutes are in docs/accuracy.md only.
class HardCases : public ::testing::TestWithParam<app::HardCase> {
 protected:
  void expect_good(const app::Machine& machine) const {
    const app::HardCase& hard = GetParam();
    const app::HardOutcome outcome = app::outcome_of(hard, machine);
    EXPECT_TRUE(outcome.good) << outcome.error << " " << outcome.message;
    if (hard.tolerance > 0) {
      EXPECT_FALSE(outcome.refused) << outcome.message;
      EXPECT_LE(outcome.error, hard.tolerance);
      return;
    }
    // The refusal must name the case's own cause.
    EXPECT_TRUE(outcome.refused);
    const std::map<std::string, std::string> causes{
        {"single phyxel", "nothing in this model resists deformation"},
        {"flattened (Hooke)", "the simulation diverged"},
        {"step 1.01", "is unstable: the largest stable step is"}};
    ASSERT_TRUE(causes.contains(hard.name)) << hard.name;
    EXPECT_THAT(outcome.message, HasSubstr(causes.at(hard.name)));
  }
  /// Cases of Newton's method exist in double only.
  static std::vector<Precision> precisions(bool gpu) {
    if (GetParam().in_double) return {Precision::double_};
    if (gpu) return {Precision::double_, Precision::single, Precision::mixed};
    return {Precision::double_, Precision::single};
  }
};
std::vector<app::HardCase> short_cases() {
  std::vector<app::HardCase> cases = app::hard_cases();
  std::erase_if(cases, [](const app::HardCase& c) { return c.is_long; });
  return cases;
}
INSTANTIATE_TEST_SUITE_P(All, HardCases, ::testing::ValuesIn(short_cases()),
                         [](const ::testing::TestParamInfo<app::HardCase>& one) {
                           std::string name = std::to_string(one.index) + "_";
                           for (const char c : one.param.name) {
                             if (std::isalnum(static_cast<unsigned char>(c))) name += c;
                           }
                           return name;
                         });
TEST_P(HardCases, IsAnsweredOrRefused) {
  for (const Precision precision : precisions(false)) {
    expect_good({app::choose_device("cpu"), precision});
  }
}
TEST_P(HardCases, IsAnsweredOrRefusedOnAGpu) {
  if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
  for (const Precision precision : precisions(true)) {
    expect_good({app::choose_device("cuda"), precision});
  }
}

TEST_F(AccuracyCommand, AnswersAnUnknownCaseWithTheNearest) {
  const auto wrong = run({"accuracy", "tensoin"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean \"tension\""));
}

}  // namespace
}  // namespace phyxel
