/// Volumes of points whose distances vary, by sample points.
#include "mesh/graded_volumes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "stage.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

/// A field that wants distances of 0.05 beyond x = 0.5, and up to 0.1 below.
SpacingField finer_beyond_the_middle() {
  SpaceRegion half;
  half.low = {0.5, -1, -1};
  half.high = {2, 2, 2};
  return {nullptr, {{half, 2}}, 0.25, 2, 0.1};
}

/// Nodes in the middles of the cells of two lattices: 0.1 wide below x = 0.5, 0.05 beyond.
std::vector<Vec3d> two_lattices() {
  std::vector<Vec3d> point;
  for (const double h : {0.1, 0.05}) {
    for (double x = (h == 0.1 ? 0 : 0.5) + 0.5 * h; x < (h == 0.1 ? 0.5 : 1); x += h) {
      for (double y = 0.5 * h; y < 1; y += h) {
        for (double z = 0.5 * h; z < 1; z += h) point.push_back({x, y, z});
      }
    }
  }
  return point;
}

double sum_of(const std::vector<Vec3d>& point, const std::vector<double>& volume, double low,
              double high) {
  double sum = 0;
  for (std::size_t k = 0; k < point.size(); ++k) {
    if (point[k].x > low && point[k].x < high) sum += volume[k];
  }
  return sum;
}

TEST(GradedVolumes, AreThoseOfTheCellsOfTwoLattices) {
  const Surface cube = test::unit_cube();
  const InsideSampler sampler(cube, true);
  const std::vector<Vec3d> point = two_lattices();
  Stage stage("volumes");
  const std::vector<double> volume =
      graded_volumes(sampler, point, {}, finer_beyond_the_middle(), 1, stage);
  EXPECT_NEAR(sum_of(point, volume, 0, 1), 1, 2e-3);
  for (std::size_t k = 0; k < point.size(); ++k) {
    if (std::abs(point[k].x - 0.5) < 0.1) continue;
    const double cell = std::pow(point[k].x < 0.5 ? 0.1 : 0.05, 3);
    EXPECT_NEAR(volume[k], cell, 0.2 * cell) << point[k].x;
  }
  // Between the lattices the cells of coarse points end nearer to these than 0.05: planes half-way
  // between (0.45, y, z) and (0.525, y, z) for four points each.
  EXPECT_LT(sum_of(point, volume, 0.4, 0.5), 0.1);
  EXPECT_GT(sum_of(point, volume, 0.5, 0.55), 0.05);
}

/// Of two parts that a cut makes, each gives its space to its own points, however far they are.
TEST(GradedVolumes, EndAtCuts) {
  const Surface cube = test::unit_cube();
  const InsideSampler sampler(cube, true);
  std::vector<Vec3d> point = two_lattices();
  std::erase_if(point, [](Vec3d p) { return p.x > 0.4 && p.x < 0.5; });
  SpaceRegion half;
  half.low = {-1, -1, -1};
  half.high = {0.5, 2, 2};
  const SupportCuts cuts{.list = {{half, half}}, .depth = 1e-9, .spacing = 0.1, .shift = 0};
  Stage stage("volumes");
  const std::vector<double> volume =
      graded_volumes(sampler, point, cuts, finer_beyond_the_middle(), 1, stage);
  EXPECT_NEAR(sum_of(point, volume, 0, 0.5), 0.5, 1e-3);
  EXPECT_NEAR(sum_of(point, volume, 0.5, 1), 0.5, 1e-3);
}

/// Blocks of a sweep with coarse cubes fill the inside once, with voxels of the sizes asked for.
TEST(InsideSampler, FillsTheInsideWithVoxelsOfSeveralSizes) {
  const Surface ball = test::sphere({0.1, 0.2, 0.3}, 1, 4);
  const InsideSampler sampler(ball, true);
  const double voxel = 0.01;
  const auto coarse = [&](Vec3d middle, double half) {
    return 0.5 * half <= voxel * (middle.x > 0.1 ? 4.1 : 1);
  };
  std::vector<SampleBlock> blocks;
  sampler.collect({.voxel = voxel, .seed = 3, .coarse = coarse}, blocks);
  std::map<double, double> volume;
  Vec3d moment;
  for (const SampleBlock& block : blocks) {
    const double one = std::pow(block.voxel, 3);
    volume[block.voxel] += one * static_cast<double>(block.offset.size());
    for (std::size_t k = 0; k < block.offset.size(); ++k) moment += one * block.position(k);
  }
  ASSERT_EQ(volume.size(), 2u);
  const double half = 0.5 * enclosed_volume(ball);
  EXPECT_NEAR(volume[voxel], half, 2e-3 * half);
  EXPECT_NEAR(volume[4 * voxel], half, 1e-2 * half);
  EXPECT_LT(norm(moment / (2 * half) - Vec3d{0.1, 0.2, 0.3}), 5e-3);
}

}  // namespace
}  // namespace phyxel
