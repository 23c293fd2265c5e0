/// Neighbour lists against brute force.
#include "phyxel/neighbourhood.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "model/space_filling_curve.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// Points whose density varies eightfold, in two clumps far apart, some at negative coordinates.
std::vector<Vec3d> uneven_points(int n) {
  std::mt19937_64 engine(11);
  std::vector<Vec3d> points;
  for (int i = 0; i < n; ++i) {
    Vec3d p = uniform_vector(engine, 1);
    if (i % 2) p = 0.5 * p + Vec3d{40, -30, 20};
    points.push_back(p);
  }
  return points;
}

std::vector<Index> brute_force_row(const std::vector<Vec3d>& points, Index i, double h) {
  std::vector<Index> row;
  for (Index j = 0; j < static_cast<Index>(points.size()); ++j) {
    if (j != i && dot(points[j] - points[i], points[j] - points[i]) < h * h) row.push_back(j);
  }
  return row;
}

std::vector<Index> as_vector(std::span<const Index> row) { return {row.begin(), row.end()}; }

class Hash : public ::testing::TestWithParam<NeighbourhoodRule::Support> {};

TEST_P(Hash, NeighboursEqualBruteForce) {
  const auto points = uneven_points(1500);
  NeighbourhoodRule rule;
  rule.support = GetParam();
  const auto spacing = mean_spacing(points, rule.nearest);
  const Neighbourhood hood = find_neighbours(points, spacing, rule);
  for (Index i = 0; i < 1500; ++i) {
    EXPECT_EQ(as_vector(hood.neighbours.row(i)), brute_force_row(points, i, hood.support[i]));
  }
}

TEST_P(Hash, InverseIsTheExactTranspose) {
  const auto points = uneven_points(1500);
  NeighbourhoodRule rule;
  rule.support = GetParam();
  for (const std::optional<int> cap : {std::optional<int>{}, std::optional<int>{9}}) {
    rule.max_neighbours = cap;
    const Neighbourhood hood = find_neighbours(points, mean_spacing(points, rule.nearest), rule);
    std::set<std::pair<Index, Index>> forward, backward;
    for (Index i = 0; i < 1500; ++i) {
      for (const Index j : hood.neighbours.row(i)) forward.emplace(i, j);
      for (const Index j : hood.inverse().row(i)) backward.emplace(j, i);
      EXPECT_TRUE(std::is_sorted(hood.inverse().row(i).begin(), hood.inverse().row(i).end()));
    }
    EXPECT_EQ(forward, backward);
    EXPECT_EQ(hood.inverse().entries(), hood.neighbours.entries());
  }
}

TEST_P(Hash, DoesNotDependOnTheNumberOfThreads) {
  const auto points = uneven_points(9000);  // more than two blocks of rows
  NeighbourhoodRule rule;
  rule.support = GetParam();
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  const auto spacing = mean_spacing(points, rule.nearest);
  const Neighbourhood one = find_neighbours(points, spacing, rule);
  omp_set_num_threads(3);
  EXPECT_EQ(mean_spacing(points, rule.nearest), spacing);
  const Neighbourhood three = find_neighbours(points, spacing, rule);
  omp_set_num_threads(before);
  EXPECT_EQ(one.neighbours.offsets, three.neighbours.offsets);
  EXPECT_EQ(one.neighbours.indices, three.neighbours.indices);
}

INSTANTIATE_TEST_SUITE_P(Support, Hash,
                         ::testing::Values(NeighbourhoodRule::Support::uniform,
                                           NeighbourhoodRule::Support::adaptive),
                         [](const auto& test) {
                           return test.param == NeighbourhoodRule::Support::uniform ? "Uniform"
                                                                                    : "Adaptive";
                         });

/// Cells of a box, wherever it lies, follow each other face to face along Hilbert's curve.
TEST(HilbertFrame, StepsThroughABoxFromCellToCell) {
  constexpr int cells = 8;
  const Vec3d low{-3, 100, 0.5};
  for (const double size : {1e-3, 1.0, 50.0}) {
    const HilbertFrame frame = HilbertFrame::around(low, low + Vec3d{size, size, size});
    std::vector<std::pair<std::uint64_t, Vec3d>> order;
    for (int k = 0; k < cells * cells * cells; ++k) {
      const Vec3d cell{k % cells + 0.5, k / cells % cells + 0.5, k / cells / cells + 0.5};
      order.emplace_back(frame.key_of(low + size / cells * cell), cell);
    }
    std::sort(order.begin(), order.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    for (std::size_t k = 1; k < order.size(); ++k) {
      ASSERT_EQ(norm(order[k].second - order[k - 1].second), 1) << size;
    }
  }
}

/// Places along the curve are places in space, whatever the size of a body and wherever it lies.
TEST(OrderAlongCurve, PutsNeighboursSideBySide) {
  for (const double size : {1e-3, 0.5, 1.0, 2e3}) {
    std::mt19937_64 engine(3);
    Cloud cloud;
    for (int i = 0; i < 4096; ++i) {  // 16 to an edge of the cube: spacings of 1/8 of `size`
      cloud.position.push_back(size * (Vec3d{-7, 5, 0} + uniform_vector(engine, 1)));
      cloud.volume.push_back(i);
    }
    cloud.regions["even"] = {};
    for (int i = 0; i < 4096; i += 2) cloud.regions["even"].push_back(i);
    const Cloud before = cloud;
    order_along_curve(cloud);
    double way = 0;
    std::set<double> seen;
    for (std::size_t i = 0; i < 4096; ++i) {
      const auto from = static_cast<std::size_t>(cloud.volume[i]);
      EXPECT_EQ(cloud.position[i], before.position[from]);
      seen.insert(cloud.volume[i]);
      if (i > 0) way += norm(cloud.position[i] - cloud.position[i - 1]);
    }
    EXPECT_EQ(seen.size(), 4096u);
    for (const Index i : cloud.regions["even"]) EXPECT_EQ(std::fmod(cloud.volume[i], 2), 0);
    EXPECT_EQ(cloud.regions["even"].size(), 2048u);
    // Two random places are 1.3 `size` apart on average; a Morton curve steps 1.7 spacings or so,
    // its long steps included.
    EXPECT_LT(way / 4095, 2.5 * size / 8);
  }
}

TEST(MeanSpacing, EqualsBruteForce) {
  auto points = uneven_points(700);
  points.push_back({4000, 0, 0});  // a stray point must neither crash nor take forever
  const auto spacing = mean_spacing(points, 10);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::vector<double> distance;
    for (std::size_t j = 0; j < points.size(); ++j) {
      if (j != i) distance.push_back(norm(points[j] - points[i]));
    }
    std::sort(distance.begin(), distance.end());
    double mean = 0;
    for (int k = 0; k < 10; ++k) mean += distance[k] / 10;
    EXPECT_NEAR(spacing[i], mean, 1e-12 * mean);  // rounding of ten square roots
  }
}

TEST(MeanSpacing, OfFewPhyxelsIsOverAllOthers) {
  const std::vector<Vec3d> two{{0, 0, 0}, {3, 4, 0}};
  EXPECT_EQ(mean_spacing(two, 10), (std::vector<double>{5, 5}));
  EXPECT_EQ(mean_spacing(std::vector<Vec3d>{{1, 2, 3}}, 10), std::vector<double>{0});
}

TEST(Neighbours, UniformCloudHas32) {
  const Cloud cloud = lattice(9, 9, 9, 0.1);
  const auto spacing = mean_spacing(cloud.position, 10);
  const Neighbourhood hood = find_neighbours(cloud.position, spacing, {});
  EXPECT_TRUE(hood.symmetric);
  EXPECT_EQ(hood.neighbours.length(4 * 81 + 4 * 9 + 4), 32);  // 6 + 12 + 8 + 6 within 2.1 spacings
}

TEST(Neighbours, CapKeepsTheNearestAndIsOneSided) {
  const auto points = uneven_points(400);
  NeighbourhoodRule rule;
  rule.max_neighbours = 7;
  const Neighbourhood hood = find_neighbours(points, mean_spacing(points, 10), rule);
  EXPECT_FALSE(hood.symmetric);
  for (Index i = 0; i < 400; ++i) {
    const auto all = brute_force_row(points, i, hood.support[i]);
    ASSERT_EQ(hood.neighbours.length(i), std::min<Index>(7, static_cast<Index>(all.size())));
    double farthest_kept = 0, nearest_dropped = 1e300;
    const auto kept = as_vector(hood.neighbours.row(i));
    for (const Index j : all) {
      const double d = norm(points[j] - points[i]);
      const bool is_kept = std::binary_search(kept.begin(), kept.end(), j);
      (is_kept ? farthest_kept : nearest_dropped) =
          is_kept ? std::max(farthest_kept, d) : std::min(nearest_dropped, d);
    }
    EXPECT_LE(farthest_kept, nearest_dropped);
  }
}

TEST(PhyxelsNear, EqualsBruteForceAndReportsTheUnreached) {
  const auto points = uneven_points(500);
  const auto spacing = mean_spacing(points, 10);
  std::vector<double> support;
  for (const double r : spacing) support.push_back(1.5 * r);
  for (const int n : {300, 8}) {  // of few places, the places are in the table
    auto places = uneven_points(n);
    places.push_back({10, 10, 10});  // out of reach of everything
    Index unreached = -1;
    const Csr rows = phyxels_near(places, points, support, &unreached);
    Index expected_unreached = 0;
    for (std::size_t s = 0; s < places.size(); ++s) {
      std::vector<Index> expected;
      Index nearest = 0;
      for (Index i = 0; i < 500; ++i) {
        const double d = norm(points[i] - places[s]);
        if (d < support[i]) expected.push_back(i);
        if (d < norm(points[nearest] - places[s])) nearest = i;
      }
      if (expected.empty()) {
        ++expected_unreached;
        expected.push_back(nearest);
      }
      EXPECT_EQ(as_vector(rows.row(static_cast<Index>(s))), expected);
    }
    EXPECT_EQ(unreached, expected_unreached);
    EXPECT_GE(unreached, 1);
  }
}

}  // namespace
}  // namespace phyxel
