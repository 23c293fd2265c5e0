/// The lattice inside a body with phyxels on its surface, and the parts it is made with.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "mesh/inside_samples.hpp"
#include "mesh/repulsion.hpp"
#include "mesh/triangle.hpp"
#include "mesh/winding_number.hpp"
#include "model/assembly.hpp"
#include "phyxel/mesh.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

Vec3d random_point(std::mt19937_64& engine, double low, double high) {
  std::uniform_real_distribution<double> along(low, high);
  const double x = along(engine), y = along(engine), z = along(engine);
  return {x, y, z};
}

double depth_in_cube(Vec3d p) { return std::min({p.x, p.y, p.z, 1 - p.x, 1 - p.y, 1 - p.z}); }

TEST(LatticeFilling, IsACubicLatticeDeepInside) {
  const Cloud cloud = sample_surface(test::unit_cube(), {.phyxels = 8000});
  // Of the cells of a lattice with 8,000 nodes, 20 along an edge, 19³ fill the cube; a turned
  // lattice takes a little more or less.
  const double rough = 1.0 / 19;
  double spacing = 0;  // lattice constant, from the first deep phyxel
  int deep = 0;
  const SpatialHash hash(cloud.position, rough);
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (depth_in_cube(cloud.position[i]) < 4.5 * rough) continue;
    ++deep;
    if (spacing == 0) spacing = std::cbrt(cloud.volume[i]);
    EXPECT_DOUBLE_EQ(cloud.volume[i], std::pow(spacing, 3));
    int beside = 0;
    hash.visit_ball(cloud.position[i], 1.2 * spacing, [&](const SpatialHash::Entry& entry) {
      const double distance = norm(entry.position - cloud.position[i]);
      if (entry.index == static_cast<Index>(i) || distance > 1.2 * spacing) return;
      // Offsets of nodes from the middle of their block are rounded to float.
      EXPECT_NEAR(distance, spacing, 1e-6 * spacing);
      ++beside;
    });
    EXPECT_EQ(beside, 6);
  }
  EXPECT_NEAR(spacing, rough, 0.03 * rough);
  EXPECT_GT(deep, 900);  // the cube's middle (1 - 9/19)³ holds a thousand
}

/// A cube beside a sheet a third as thick as the phyxels' spacing: the sheet holds fewer phyxels
/// than its volume would, and the cube gets them all.
TEST(LatticeFilling, ThickPartsAreFullBesideThinOnes) {
  const Surface both = test::together(test::unit_cube(), test::box({2, 0, 0}, {4, 2, 0.02}));
  const Cloud cloud = sample_surface(both, {.phyxels = 6000});
  std::vector<Vec3d> in_cube;
  double largest = 0;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (cloud.position[i].x > 1.5) continue;
    in_cube.push_back(cloud.position[i]);
    largest = std::max(largest, cloud.volume[i]);
  }
  const auto n = static_cast<double>(in_cube.size());
  const double spacing = std::cbrt(1 / n);
  EXPECT_LT(largest * n, 1.7);  // 1.42 here; 1.95 if the lattice is as fine as the volume asks
  const SpatialHash hash(in_cube, spacing);
  std::mt19937_64 engine(8);
  double hole = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    hole = std::max(hole, hash.nearest(random_point(engine, 0, 1)).distance2);
  }
  // Half the diagonal of a cell is 0.87: 0.91 here; 0.98 if nodes stop short of the surface.
  EXPECT_LT(std::sqrt(hole), 0.95 * spacing);
}

/// The mean square distance of a bar's matter from its middle plane, which its bending stiffness is
/// made of. Equal layers of phyxels with half a layer on either face would have 1 + 2 (s/H)² of it.
TEST(LatticeFilling, VolumesHaveTheMomentsOfTheBody) {
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {4, 1, 1}), {.phyxels = 4000});
  double first = 0, second = 0;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    const double z = cloud.position[i].z - 0.5;
    first += cloud.volume[i] * z / 4;
    second += cloud.volume[i] * z * z / 4;
  }
  const double layers = 2 * 0.1 * 0.1;  // ten across
  // Half a per mille of the height: the noise of the sampled volumes, 3% each of 2,000 phyxels.
  EXPECT_NEAR(first, 0, 5e-4);
  EXPECT_NEAR(12 * second, 1 + layers, 0.25 * layers);
}

TEST(LatticeFilling, TurnedGridsHoldTheNodesInside) {
  const Surface body =
      test::together(test::sphere({0.2, 0, 0}, 0.5, 3), test::box({1, 0, 0}, {2, 0.4, 0.7}));
  const WindingNumber winding(body);
  const Mat3d turn = rotation_by({0.3, -0.8, 0.5});
  const double voxel = 0.043;
  std::vector<SampleBlock> blocks;
  InsideSampler(body, true)
      .collect({.voxel = voxel, .seed = 7, .at_random = false, .turn = turn}, blocks);
  std::vector<Vec3d> node;
  for (const SampleBlock& block : blocks) {
    for (std::size_t k = 0; k < block.offset.size(); ++k) node.push_back(block.position(k));
  }
  ASSERT_FALSE(node.empty());
  // Every node of the lattice that is inside, and no other, from all that the body's box may hold.
  const Vec3d first = node.front();
  std::size_t inside = 0;
  for (int x = -80; x <= 80; ++x) {
    for (int y = -80; y <= 80; ++y) {
      for (int z = -80; z <= 80; ++z) {
        const Vec3d p = first + turn * (voxel * Vec3d{double(x), double(y), double(z)});
        if (p.x < -0.31 || p.x > 2.01 || std::abs(p.y) > 0.51 || p.z < -0.51 || p.z > 0.71)
          continue;
        inside += winding(p) > 0.5;
      }
    }
  }
  EXPECT_EQ(node.size(), inside);
  for (const Vec3d& p : node) {
    const Vec3d cells = transpose(turn) * (p - first) / voxel;
    for (const double c : {cells.x, cells.y, cells.z}) EXPECT_NEAR(c, std::round(c), 1e-5);
  }
}

TEST(LatticeFilling, CellsThatAreNotWantedAreLeftOut) {
  const Surface cube = test::unit_cube();
  const InsideSampler sampler(cube, true);
  std::vector<SampleBlock> all, some;
  const SampleTally whole = sampler.collect({.voxel = 0.01, .seed = 3}, all);
  const SampleTally part = sampler.collect(
      {.voxel = 0.01, .seed = 3, .wanted = [](Vec3d m, double half) { return m.x - half < 0.3; }},
      some);
  EXPECT_LT(part.samples, whole.samples / 2);
  // What is wanted is there, with the same points.
  std::size_t wanted = 0, found = 0;
  const auto count = [](const std::vector<SampleBlock>& blocks, std::size_t& n) {
    for (const SampleBlock& block : blocks) {
      for (std::size_t k = 0; k < block.offset.size(); ++k) n += block.position(k).x < 0.25;
    }
  };
  count(all, wanted);
  count(some, found);
  EXPECT_EQ(found, wanted);
}

TEST(LatticeFilling, ADisplacedNodeOfALatticeGoesSixTenthsBack) {
  std::vector<Vec3d> lattice;
  const double a = 0.2;
  for (int x = -3; x <= 3; ++x) {
    for (int y = -3; y <= 3; ++y) {
      for (int z = -3; z <= 3; ++z) lattice.push_back(a * Vec3d{double(x), double(y), double(z)});
    }
  }
  const Repulsion repulsion(lattice, a);
  const auto self = static_cast<Index>(lattice.size() / 2);
  for (const Vec3d off : {Vec3d{1e-4, 0, 0}, Vec3d{0, -1e-4, 0}, Vec3d{6e-5, 6e-5, 6e-5}}) {
    const Vec3d step = repulsion.step(a * off, self, [](Index) { return 1.0; });
    EXPECT_LT(norm(step + 0.6 * a * off), 0.01 * norm(a * off));  // 0.998, and terms of order 2
  }
  // Steps are no longer than 0.15 spacings.
  EXPECT_NEAR(norm(repulsion.step(a * Vec3d{0.9, 0.1, 0}, self, [](Index) { return 1.0; })),
              0.15 * a, 1e-12);
}

TEST(LatticeFilling, TheNearestPointOfATriangleIsThatOfAllItsPoints) {
  std::mt19937_64 engine(5);
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3d a = random_point(engine, 0, 1), b = random_point(engine, 0, 1),
                c = random_point(engine, 0, 1), p = random_point(engine, -1, 2);
    const double found = norm(nearest_on_triangle(p, a, b, c) - p);
    double nearest = HUGE_VAL;
    constexpr int n = 60;
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; i + j <= n; ++j) {
        const Vec3d q = a + (double(i) / n) * (b - a) + (double(j) / n) * (c - a);
        nearest = std::min(nearest, norm(q - p));
      }
    }
    EXPECT_LE(found, nearest * (1 + 1e-12));
    EXPECT_GE(found, nearest - 2.0 / n);  // the points are as far apart as that
  }
}

TEST(LatticeFilling, TheNearestPointOfAHashIsThatOfAllPoints) {
  std::mt19937_64 engine(9);
  std::vector<Vec3d> point(500);
  for (Vec3d& p : point) p = random_point(engine, 0, 1);
  const SpatialHash hash(point, 0.07);
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3d place = random_point(engine, -0.5, 1.5);
    const auto except = static_cast<Index>(trial);
    double nearest = HUGE_VAL;
    for (std::size_t i = 0; i < point.size(); ++i) {
      if (static_cast<Index>(i) != except) nearest = std::min(nearest, norm(point[i] - place));
    }
    const SpatialHash::Nearest found = hash.nearest(place, HUGE_VAL, except);
    EXPECT_DOUBLE_EQ(std::sqrt(found.distance2), nearest);
    EXPECT_NE(found.index, except);
    EXPECT_EQ(norm(point[static_cast<std::size_t>(found.index)] - place - found.apart), 0);
    // Within a limit the same point is found; beyond it, perhaps none.
    EXPECT_EQ(hash.nearest(place, nearest, except).index, found.index);
    const SpatialHash::Nearest limited = hash.nearest(place, 0.5 * nearest, except);
    EXPECT_TRUE(limited.index == -1 || std::sqrt(limited.distance2) >= nearest);
  }
}

}  // namespace
}  // namespace phyxel
