/// Friction in implicit steps and at rest on several ranks under mpirun.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <tuple>

#include "mpirun.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using ::testing::HasSubstr;

/// A block that is pulled sideways on another one, which lies on a rough floor.
std::string pulled_blocks(const std::string& method, double young, double friction) {
  const auto block = [&](const std::string& name, double size, double spacing, double z) {
    return "[[body]]\nname = '" + name +
           "'\nshape = 'block'\nsize = " + fmt::format("[{0}, {0}, {0}]", size) +
           "\nspacing = " + std::to_string(spacing) + "\nlattice = 'nodes'\ntranslation = [0, 0, " +
           std::to_string(z) + "]\n[body.material]\nyoung = " + std::to_string(young) +
           "\npoisson = 0.3\ndensity = 1000\n";
  };
  return "gravity = [3, 0, -9.81]\n[time]\nend = 0.1\nstep = 0.01\n[solver]\nmethod = '" + method +
         "'\nprecision = 'double'\n[output]\nframes_per_second = 50\n" +
         "[[obstacle]]\nshape = 'plane'\ntranslation = [0, 0, -0.1]\nfriction = 0.5\n" +
         "[contact]\nfriction = " + std::to_string(friction) + "\n" + block("lower", 0.2, 0.05, 0) +
         block("upper", 0.12, 0.04, 0.16);
}

TEST_F(Mpirun, FrictionIsTheSameOnAllRanks) {
  // The upper block slides in steps, and rests at rest.
  for (const auto& [method, young, friction] :
       {std::tuple{"implicit", 1e5, 0.25}, {"equilibrium", 1e6, 0.5}}) {
    const std::string name = method, scene = name + ".toml";
    write(scene, pulled_blocks(method, young, friction));
    const Outcome alone = run_on(0, {"run", scene, "--out", name});
    ASSERT_EQ(alone.code, 0) << alone.err;
    EXPECT_THAT(test::text_of(folder_ / name / "contacts.csv"), HasSubstr("upper,body,"));
    for (const int ranks : {2, 3}) {
      const std::string other = name + std::to_string(ranks);
      const Outcome outcome = run_on(ranks, {"run", scene, "--out", other});
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      expect_same_files(name, other);
    }
  }
}

}  // namespace
}  // namespace phyxel
