/// The warning of a run whose energy has drifted.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/program.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;
using ::testing::Not;

class EnergyDrift : public test::Program {
 protected:
  /// A body of three layers of phyxels, two of them fixed. Most of its motion is in modes near the
  /// fastest one, which steps at the stability limit do not resolve.
  Outcome run_with(const std::string& safety) const {
    write("beam.toml", R"(
[time]
end = 0.0686
safety = )" + safety + R"(
[solver]
device = "cpu"
precision = "double"
threads = 1
[output]
directory = "out"
frames_per_second = 0
[[body]]
name = "beam"
shape = "beam"
size = [0.2, 0.1, 0.1]
spacing = 0.1
velocity = [1, 0, 0]
[body.material]
young = 1e5
poisson = 0
density = 1000
law = "small-strain"
[[body.fixed]]
ball = { centre = [-5, 0, 0], radius = 5.15 }
)");
    return run({"run", "beam.toml", "--force"});
  }
};

TEST_F(EnergyDrift, IsAWarningOfTheSummaryAndOfItsFile) {
  const Outcome coarse = run_with("0.99");
  ASSERT_EQ(coarse.code, 0) << coarse.err;
  const auto told = nlohmann::json::parse(text_of(folder_ / "out" / "run.json"));
  EXPECT_GT(told["energy_drift"], 0.2);
  EXPECT_THAT(coarse.out, HasSubstr(fmt::format(
                              "warning     energy has drifted by {:.0f}% of the largest kinetic + "
                              "elastic energy",
                              100 * told["energy_drift"].get<double>())));
  ASSERT_EQ(told["warnings"].size(), 1u);
  EXPECT_THAT(told["warnings"][0].get<std::string>(), HasSubstr("a smaller time.safety may help"));

  const Outcome fine = run_with("0.2");
  ASSERT_EQ(fine.code, 0) << fine.err;
  EXPECT_THAT(fine.out, Not(HasSubstr("has drifted")));
  EXPECT_TRUE(nlohmann::json::parse(text_of(folder_ / "out" / "run.json"))["warnings"].empty());
}

}  // namespace
}  // namespace phyxel
