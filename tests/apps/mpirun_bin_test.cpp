/// A hundred bodies in a bin, on several ranks under mpirun and after a restart.
#include <gtest/gtest.h>

#include <filesystem>

#include "mpirun.hpp"
#include "support/csv_column.hpp"

namespace phyxel {
namespace {

using test::csv_column;
using test::Outcome;
using test::text_of;

/// A hundred blocks of 27 phyxels fall into a bin and come to rest in a heap.
constexpr const char* bin =
    "gravity = [0, 0, -9.81]\n[time]\nend = 0.8\n[solver]\ndevice = 'cpu'\nthreads = 1\n"
    "[output]\nframes_per_second = 10\n[contact]\nfriction = 0.3\n"
    "[[obstacle]]\nname = 'bin'\nshape = 'box'\nsize = [0.9, 0.9, 3]\nhollow = true\n"
    "translation = [0.32, 0.32, 1.4]\nfriction = 0.3\n"
    "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.1, 0.1, 0.1]\nspacing = 0.05\n"
    "rotation = [17, 31, 5]\n[body.material]\nyoung = 2e5\npoisson = 0.3\ndensity = 1000\n"
    "damping = 2\n[body.array]\ncount = [5, 5, 4]\nspacing = [0.16, 0.16, 0.18]\n";

TEST_F(Mpirun, AHeapIsTheSameOnAllRanksAndAfterARestart) {
  write("scene.toml", bin);
  const Outcome alone = run_on(0, {"run", "scene.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  const Outcome together = run_on(3, {"run", "scene.toml", "--out", "together"});
  ASSERT_EQ(together.code, 0) << together.err;
  expect_same_files("alone", "together");
  // In the middle of the impacts, on other ranks.
  ASSERT_EQ(run_on(2, {"run", "scene.toml", "--out", "resumed", "--until", "0.3"}).code, 0);
  const Outcome resumed = run_on(0, {"run", "scene.toml", "--out", "resumed", "--resume", "auto"});
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  for (const char* file : {"phyxels_000008.hdf", "energy.csv", "contacts.csv"}) {
    EXPECT_TRUE(text_of(folder_ / "alone" / file) == text_of(folder_ / "resumed" / file)) << file;
  }
  // Impacts and friction have taken most of the energy, and no block is left deep in another.
  const std::string energy = text_of(folder_ / "alone/energy.csv");
  const std::vector<double> kinetic = csv_column(energy, "kinetic_energy");
  EXPECT_GT(*std::max_element(kinetic.begin(), kinetic.end()), 50);
  EXPECT_LT(kinetic.back(), 10);
  const std::vector<double> depth = csv_column(text_of(folder_ / "alone/contacts.csv"), "depth");
  EXPECT_LT(*std::max_element(depth.end() - 101, depth.end()), 0.2 * 0.05);  // bin and blocks
}

}  // namespace
}  // namespace phyxel
