/// The warning of a run in whose steps single precision cannot resolve how a history changes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/program.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using ::testing::HasSubstr;
using ::testing::Not;

class SlowHistory : public test::Program {
 protected:
  /// A few steps of a block that relaxes within a time [s].
  Outcome run_with(const std::string& time, const std::string& precision) const {
    write("block.toml", R"(
[time]
end = 0.01
[solver]
device = "cpu"
threads = 1
[output]
directory = "out"
frames_per_second = 0
[[body]]
name = "block"
shape = "block"
size = [0.2, 0.1, 0.1]
spacing = 0.05
[body.material]
law = "maxwell"
young = 1e5
poisson = 0.3
density = 1000
relaxation = [[0.1, 0.2], [)" +
                            time + R"(, 0.3]]
)");
    return run({"run", "block.toml", "--force", "--precision", precision});
  }
};

TEST_F(SlowHistory, IsAWarningInSinglePrecision) {
  for (const char* precision : {"float", "mixed"}) {
    const Outcome slow = run_with("1000", precision);
    ASSERT_EQ(slow.code, 0) << slow.err;
    EXPECT_THAT(slow.out, HasSubstr("warning     body \"block\" relaxes in "));
    EXPECT_THAT(slow.out, HasSubstr("allowed: up to 100000 steps, or precision double"));
  }
  EXPECT_THAT(run_with("1000", "double").out, Not(HasSubstr("warning")));
  EXPECT_THAT(run_with("10", "float").out, Not(HasSubstr("warning")));
}

}  // namespace
}  // namespace phyxel
