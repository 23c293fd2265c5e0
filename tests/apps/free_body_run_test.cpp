/// What a run says of a free body that rests on held phyxels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/program.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using ::testing::HasSubstr;
using ::testing::Not;

class FreeBodyRun : public test::Program {
 protected:
  /// A box of a kilogram on a block whose phyxels are held along axes.
  Outcome run_with(const std::string& axes, const std::string& method) const {
    write("rest.toml", R"(
gravity = [0, 0, -9.81]
[time]
end = 0.1
[solver]
device = "cpu"
precision = "double"
threads = 1
[output]
directory = "out"
frames_per_second = 50
[[body]]
name = "base"
shape = "block"
size = [0.2, 0.2, 0.05]
spacing = 0.025
translation = [0, 0, -0.025]
[body.material]
young = 1e6
poisson = 0.3
density = 1000
[[body.fixed]]
box = [[-1, -1, -1], [1, 1, 1]]
axes = ")" + axes + R"("
[[obstacle]]
name = "top"
shape = "box"
size = [0.1, 0.1, 0.1]
density = 1000
translation = [0, 0, 0.05]
friction = 0.3
method = ")" + method + "\"\n");
    return run({"run", "rest.toml", "--force"});
  }
};

/// Contact lifts it by as much as it falls in the first step, which is not worth a warning.
TEST_F(FreeBodyRun, AStartAtRestIsNoWarning) {
  const Outcome outcome = run_with("xyz", "projected");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("contact     top"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("has made")));
}

/// Phyxels that are free across the normal alone cannot push by moving: the run ends, says why, and
/// what it suggests helps.
TEST_F(FreeBodyRun, PhyxelsHeldAlongItsNormalNeedPenalties) {
  const Outcome falls = run_with("z", "projected");
  EXPECT_NE(falls.code, 0);
  EXPECT_THAT(falls.err, HasSubstr("supports hold them along its normal but not along all axes"));
  EXPECT_THAT(falls.err, HasSubstr("method = \"penalty\" of the obstacle"));
  const Outcome rests = run_with("z", "penalty");
  EXPECT_EQ(rests.code, 0) << rests.err;
  EXPECT_THAT(rests.err, Not(HasSubstr("deep in obstacle")));
}

}  // namespace
}  // namespace phyxel
