/// Refusals on several ranks: all ranks stop, and one of them prints the message once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mpirun.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;

TEST_F(Mpirun, WrongInputIsToldOnce) {
  write_scene();
  write("kept", "precious");
  write("huge.toml", R"(
[time]
end = 1.0
[output]
directory = "out"
[[body]]
name = "huge"
shape = "beam"
size = [1.0, 1.0, 1.0]
spacing = 1e-4
[body.material]
young = 2e5
poisson = 0.3
density = 1000
)");
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const std::string material = "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1e3\n";
  write("flat.toml", "[time]\nend = 1\n[[body]]\nmesh = \"flat.obj\"\nphyxels = 50\n" + material);
  write("loose.toml",
        "[time]\nend = 1\n[[body]]\nshape = \"beam\"\nsize = [1, 1, 1]\nspacing = "
        "0.2\n[[body.fixed]]\n"
        "\n\nregion = \"left\"\n" +
            material);
  const struct {
    std::vector<std::string> arguments;
    std::string message;
  } cases[] = {
      {{"run", "missing.toml"}, "missing.toml"},
      {{"run", "scene.toml", "--partitioner", "metiss"}, "--partitioner metiss"},
      {{"run", "scene.toml", "--step", "1"}, "error: scene.toml: time.step = 1 s is unstable"},
      {{"run", "scene.toml", "--transport", "pigeon"}, "--transport pigeon"},
      {{"run", "huge.toml"}, "error: huge.toml:6:1: body \"huge\": "},
      {{"run", "flat.toml"}, "error: flat.toml:3:1: body \"flat\": flat.obj: the surface"},
      {{"run", "loose.toml"}, "error: loose.toml:10:10: body \"beam\" has no region"},
      {{"run", "scene.toml", "--out", "kept"}, "kept"},
      {{"render", "out"}, "2 ranks"}};
  for (const auto& c : cases) {
    const Outcome outcome = run_on(2, c.arguments);
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(count_of(c.message, outcome.err), 1) << outcome.err;
  }
  EXPECT_EQ(text_of(folder_ / "kept"), "precious");
  EXPECT_EQ(count_of("Usage:", run_on(2, {"--help"}).out), 1);
}

/// Options that change the plan must be equal on all ranks, each of which reads its own command
/// line; otherwise ranks would step to different ends and wait for each other for ever.
TEST_F(Mpirun, OptionsThatDifferBetweenRanksAreToldOnce) {
  write_scene();
  const struct {
    const char *option, *first, *second;
  } cases[] = {{"--until", "0.1", "0.05"},
               {"--step", "1e-4", "2e-4"},
               {"--precision", "float", "double"},
               {"--method", "verlet", "equilibrium"}};
  for (const auto& c : cases) {
    SCOPED_TRACE(c.option);
    use_ranks(1);
    const Outcome outcome = run({"run", "scene.toml", c.option, c.first, ":", "-n", "1",
                                 PHYXEL_PROGRAM, "run", "scene.toml", c.option, c.second});
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(count_of("phyxel: error: the ranks have different options", outcome.err), 1)
        << outcome.err;
    EXPECT_EQ(count_of("error: ", outcome.err), 1) << outcome.err;
    EXPECT_FALSE(fs::exists(folder_ / "out"));
  }
}

}  // namespace
}  // namespace phyxel
