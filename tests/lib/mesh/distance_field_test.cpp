/// Fields of distances against shapes whose distances are known.
#include "mesh/distance_field.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

#include "mesh/winding_number.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::test;

/// Points spread evenly over a cube about the origin.
std::vector<Vec3d> points_within(double half, int count) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> of(-half, half);
  std::vector<Vec3d> points;
  for (int k = 0; k < count; ++k) {
    const double x = of(random), y = of(random);
    points.push_back({x, y, of(random)});
  }
  return points;
}

TEST(DistanceFields, AreExactBesideFlatFaces) {
  const Surface surface = box({-1, -0.7, -0.4}, {1, 0.7, 0.4});
  const DistanceArrays made = distances_from(surface, 0.05, 0.2);
  const DistanceField field = made.view();
  const BoxObstacle exact{2, 1.4, 0.8};
  int beside = 0;
  for (const Vec3d x : points_within(1.2, 20000)) {
    const Gap gap = exact.gap(x);
    if (std::abs(gap.distance) > 0.2) continue;
    // Cells that the planes of two faces' bisector cut are left out.
    const Vec3d corner{std::abs(x.x) - 1, std::abs(x.y) - 0.7, std::abs(x.z) - 0.4};
    double beyond[] = {corner.x, corner.y, corner.z};
    std::sort(beyond, beyond + 3);
    if (beyond[1] > -0.11 || beyond[2] - beyond[1] < 0.11) continue;
    ++beside;
    // Rounding of the nodes, which are floats.
    EXPECT_NEAR(field.gap(x).distance, gap.distance, 1e-6);
    EXPECT_LE(norm(field.gap(x).normal - gap.normal), 1e-5);
  }
  EXPECT_GT(beside, 500);
}

/// The largest error of distances beside a sphere's surface [m], and of normals.
std::pair<double, double> errors_at_sphere(double spacing) {
  const Surface surface = sphere({}, 1, 6);  // whose faces lie within 2e-4 of the sphere
  const DistanceArrays made = distances_from(surface, spacing, 0.2);
  std::pair<double, double> worst{0, 0};
  for (const Vec3d x : points_within(1.2, 20000)) {
    if (std::abs(norm(x) - 1) > 0.15) continue;
    const Gap gap = made.view().gap(x);
    worst.first = std::max(worst.first, std::abs(gap.distance - (norm(x) - 1)));
    worst.second = std::max(worst.second, norm(gap.normal - normalised(x)));
  }
  return worst;
}

TEST(DistanceFields, OfCurvedSurfacesConvergeToSecondOrder) {
  const auto [coarse, coarse_normal] = errors_at_sphere(0.1);
  const auto [fine, fine_normal] = errors_at_sphere(0.05);
  EXPECT_GT(std::log2((coarse - 2e-4) / (fine - 2e-4)), 1.7);
  EXPECT_LT(fine, 0.0015);                                 // h² / (4 R) is 6e-4, twice
  EXPECT_GT(std::log2(coarse_normal / fine_normal), 0.7);  // its gradient is of first order
  EXPECT_LT(fine_normal, 0.06);
}

TEST(DistanceFields, KnowInsideFromOutside) {
  // Two balls that overlap, and a cavity inside the larger one.
  const Surface surface = together(together(sphere({}, 0.8, 3), sphere({0.7, 0.2, 0}, 0.4, 3)),
                                   turned(sphere({-0.2, 0, 0}, 0.3, 3)));
  const DistanceArrays made = distances_from(surface, 0.04, 0.1);
  const DistanceField field = made.view();
  int inside = 0;
  for (const Vec3d x : points_within(1.3, 20000)) {
    const double distance = field.gap(x).distance;
    if (std::abs(distance) < 0.02) continue;  // as near as the grid can tell
    const bool is_inside = direct_winding_number(surface.position, surface.triangle, x) > 0.5;
    inside += is_inside;
    ASSERT_EQ(distance < 0, is_inside) << x.x << ' ' << x.y << ' ' << x.z;
  }
  EXPECT_GT(inside, 1000);
}

TEST(DistanceFields, AreLowerBoundsFarAway) {
  const DistanceArrays made = distances_from(sphere({}, 1, 3), 0.05, 0.1);
  for (const Vec3d x : points_within(30, 2000)) {
    if (norm(x) < 2) continue;
    const Gap gap = made.view().gap(x);
    EXPECT_LE(gap.distance, norm(x) - 0.99);
    EXPECT_GT(gap.distance, 0.5 * (norm(x) - 1));
    EXPECT_GT(dot(gap.normal, normalised(x)), 0.5);
  }
}

TEST(DistanceFields, AreExactAboveFlatFacesHoweverFarAway) {
  // A cell is 0.4 wide, so that the grid reaches farther beyond some faces than beyond others.
  const DistanceArrays made = distances_from(box({-1, -0.9, -0.8}, {1, 0.9, 0.8}), 0.05, 0.1);
  for (const double away : {0.1, 0.3, 0.7, 1.0, 3.0}) {
    EXPECT_NEAR(made.view().gap({0.2, 0.3, 0.8 + away}).distance, away, 1e-6);
    EXPECT_NEAR(made.view().gap({0.2, -0.9 - away, 0.1}).distance, away, 1e-6);
    EXPECT_NEAR(made.view().gap({1 + away, 0.3, 0.1}).distance, away, 1e-6);
  }
}

TEST(DistanceFields, HaveTheMarginAskedFor) {
  // Beside the middle of an edge of its box, a ball is farther away than the box.
  const Surface ball = sphere({}, 1, 3);
  const Vec3d x{1.75, 1.75, 0};
  EXPECT_LT(distances_from(ball, 0.05, 0.1).view().gap(x).distance, 1.1);
  EXPECT_NEAR(distances_from(ball, 0.05, 0.1, 0.8).view().gap(x).distance, norm(x) - 1, 0.03);
}

TEST(DistanceFields, KnowTheirDeepestPlace) {
  const DistanceArrays made = distances_from(box({2, 0, 0}, {4, 1, 6}), 0.05, 0.1);
  EXPECT_NEAR(made.depth, 0.5, 0.05);
  EXPECT_NEAR(made.deepest.y, 0.5, 0.05);
}

TEST(DistanceFields, HaveTheSameBitsOnAnyThreads) {
  const Surface surface = sphere({0.1, 0.2, 0.3}, 1, 3);
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  const DistanceArrays one = distances_from(surface, 0.05, 0.1);
  omp_set_num_threads(3);
  const DistanceArrays three = distances_from(surface, 0.05, 0.1);
  omp_set_num_threads(before);
  ASSERT_EQ(one.fine.size(), three.fine.size());
  EXPECT_EQ(one.brick, three.brick);
  EXPECT_EQ(std::memcmp(one.fine.data(), three.fine.data(), one.fine.size() * sizeof(float)), 0);
  EXPECT_EQ(std::memcmp(one.coarse.data(), three.coarse.data(), one.coarse.size() * sizeof(float)),
            0);
}

TEST(DistanceFields, AreCoarserThanAskedIfTheyWereTooLarge) {
  const Surface surface = sphere({}, 1, 2);
  const DistanceArrays made = distances_from(surface, 1e-3, 2e-3, 0, 1e6);
  EXPECT_GT(made.shape.spacing, 1e-3);
  EXPECT_LE(static_cast<double>(made.fine.size() + made.coarse.size()), 1e6);
  EXPECT_NEAR(made.view().gap({1.01, 0, 0}).distance, 0.01, 0.005);
}

}  // namespace
}  // namespace phyxel
