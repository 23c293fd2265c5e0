/// Bodies far from the origin: frames resolve the distances of points, also on ranks and after
/// restarts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "device.hpp"
#include "files/frame_file.hpp"
#include "files/hdf5_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/model.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;

/// The tests run on the CPU, and on a GPU if there is one.
class FarAway : public test::Program, public ::testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    Program::SetUp();
    if (GetParam() == std::string("cuda") && cuda_devices().empty()) {
      GTEST_SKIP() << "no CUDA device";
    }
  }
  /// A beam in float and the horn bug, which has surfels.
  std::string scene(const std::string& body) const {
    return R"(
[time]
end = 0.1
[solver]
threads = 1
device = ")" +
           std::string(GetParam()) + R"("
precision = "float"
[output]
directory = "out"
frames_per_second = 50
[[body]]
shape = "beam"
size = [0.6, 0.2, 0.2]
spacing = 0.05
)" + body + R"(
[body.material]
young = 2e5
poisson = 0.3
density = 1000
[[body]]
shape = "horn_bug"
)" + body + R"(
[body.material]
young = 6e5
poisson = 0.3
density = 1000
)";
  }
  Outcome run_on(int ranks, const std::vector<std::string>& arguments) {
    launcher_ = {PHYXEL_MPIRUN, "--allow-run-as-root", "--oversubscribe", "-n",
                 std::to_string(ranks)};
    environment_ = {{"ASAN_OPTIONS", "detect_leaks=0"}};  // Open MPI leaks
    const Outcome outcome = run(arguments);
    launcher_ = {};
    return outcome;
  }
  FrameData frame(const std::string& folder, const char* family, std::size_t k) const {
    return read_frame(
        read_series(folder_ / folder / (family + std::string(".hdf.series")))[k].file);
  }
  /// The frames, series and log of a folder, by name.
  std::map<std::string, std::string> frames_of(const std::string& folder) const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::directory_iterator(folder_ / folder)) {
      const std::string name = entry.path().filename().string();
      if (name.find(".hdf") != name.npos || name == "energy.csv") files[name] = text_of(entry);
    }
    EXPECT_EQ(files.size(), 15u);  // six frames of two families, two series, one log
    return files;
  }
};

std::size_t coinciding(std::vector<Vec3d> points) {
  const auto key = [](const Vec3d& p) { return std::tuple(p.x, p.y, p.z); };
  std::sort(points.begin(), points.end(),
            [&](const Vec3d& a, const Vec3d& b) { return key(a) < key(b); });
  std::size_t same = 0;
  for (std::size_t k = 1; k < points.size(); ++k) same += key(points[k]) == key(points[k - 1]);
  return same;
}

TEST_P(FarAway, FramesKeepTheDistancesBetweenNeighbours) {
  const Model near = build_model(read_scene(write("near.toml", scene(""))));
  write("far.toml", scene("translation = [1e7, -1e7, 1e7]"));
  const Outcome outcome = run({"run", "far.toml"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const FrameData phyxels = frame("out", "phyxels", 0), surface = frame("out", "surface", 0);
  ASSERT_EQ(phyxels.point.size(), near.position.size());
  ASSERT_EQ(surface.point.size(), near.surfels.position.size());
  EXPECT_EQ(coinciding(phyxels.point), 0u);
  EXPECT_EQ(coinciding(surface.point), coinciding(near.surfels.position));
  // At rest in frame 0. Doubles are 1.9 nm apart there; a millionth of the bodies' spacings, 0.05 m
  // and more, is 50 nm.
  for (Index i = 0; i < near.size(); ++i) {
    for (const Index j : near.neighbourhood.neighbours.row(i)) {
      EXPECT_NEAR(norm(phyxels.point[i] - phyxels.point[j]),
                  norm(near.position[i] - near.position[j]), 5e-8);
    }
  }
  for (const auto& [a, b, c] : near.surfels.triangle) {
    EXPECT_NEAR(norm(surface.point[a] - surface.point[b]),
                norm(near.surfels.position[a] - near.surfels.position[b]), 5e-8);
  }

  // One file of all frames holds the same numbers.
  ASSERT_EQ(run({"export", "out/phyxels.hdf.series", "--single", "all.vtkhdf"}).code, 0);
  const auto all = Hdf5Reader(folder_ / "all.vtkhdf").vectors("/VTKHDF/Points");
  ASSERT_EQ(all.size(), 6 * phyxels.point.size());
  EXPECT_TRUE(std::equal(phyxels.point.begin(), phyxels.point.end(), all.begin()));
}

/// Frames of a run in float near the origin have positions in float.
TEST_P(FarAway, FramesNearTheOriginStayFloat) {
  write("near.toml", scene("translation = [3, 0, 0]"));
  ASSERT_EQ(run({"run", "near.toml", "--until", "0.02"}).code, 0);
  for (const char* family : {"phyxels", "surface"}) {
    const auto series = read_series(folder_ / "out" / (family + std::string(".hdf.series")));
    EXPECT_FALSE(Hdf5Reader(series[1].file).has_attribute("/phyxel", far_attribute));
    for (const Vec3d& p : read_frame(series[1].file).point) {
      EXPECT_EQ(p.x, static_cast<double>(static_cast<float>(p.x)));
    }
  }
}

/// For bodies that fly away, the first frames have floats and the last ones doubles; the frame of
/// the change is the same on two ranks and after a restart.
TEST_P(FarAway, FramesTurnToDoubleAtTheSameTimeOnRanksAndAfterRestarts) {
  // Float is precise enough for a spacing of 0.05 m up to 0.05e-3 m / 2^-23 = 420 m, and for
  // surfels up to a shorter distance; the bodies fly 600 m.
  write("thrown.toml", scene("velocity = [6000, 0, 0]"));
  const Outcome whole = run({"run", "thrown.toml", "--out", "whole"});
  ASSERT_EQ(whole.code, 0) << whole.err;
  const auto frames = frames_of("whole");
  for (const char* family : {"phyxels", "surface"}) {
    const auto series = read_series(folder_ / "whole" / (family + std::string(".hdf.series")));
    const auto is_far = [](const SeriesEntry& entry) {
      return Hdf5Reader(entry.file).has_attribute("/phyxel", far_attribute);
    };
    EXPECT_FALSE(is_far(series.front())) << family;
    EXPECT_TRUE(is_far(series.back())) << family;
    EXPECT_TRUE(std::is_partitioned(series.begin(), series.end(), std::not_fn(is_far)));
  }
  ASSERT_EQ(run({"run", "thrown.toml", "--out", "parts", "--until", "0.04"}).code, 0);
  ASSERT_EQ(run({"run", "thrown.toml", "--out", "parts", "--resume", "auto"}).code, 0);
  EXPECT_TRUE(frames_of("parts") == frames);
  PHYXEL_NEEDS_TOOL(std::string(PHYXEL_MPIRUN) != "", "mpirun");
  const Outcome ranks = run_on(2, {"run", "thrown.toml", "--out", "ranks"});
  ASSERT_EQ(ranks.code, 0) << ranks.err;
  EXPECT_TRUE(frames_of("ranks") == frames);
}

TEST_P(FarAway, FramesAreTheSameBytesOnTwoRanks) {
  PHYXEL_NEEDS_TOOL(std::string(PHYXEL_MPIRUN) != "", "mpirun");
  write("far.toml", scene("translation = [1e7, -1e7, 1e7]"));
  ASSERT_EQ(run({"run", "far.toml", "--out", "one"}).code, 0);
  const Outcome ranks = run_on(2, {"run", "far.toml", "--out", "two"});
  ASSERT_EQ(ranks.code, 0) << ranks.err;
  EXPECT_TRUE(frames_of("one") == frames_of("two"));
}

INSTANTIATE_TEST_SUITE_P(Frames, FarAway, ::testing::Values("cpu", "cuda"),
                         [](const auto& device) { return std::string(device.param); });

}  // namespace
}  // namespace phyxel
