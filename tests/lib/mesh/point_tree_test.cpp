/// Searches in a tree of boxes around points, and the thickness of bodies.
#include "mesh/point_tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "mesh/thickness.hpp"

namespace phyxel {
namespace {

std::vector<Vec3d> random_points(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> along(0, 1);
  std::vector<Vec3d> points(n);
  for (Vec3d& p : points) p = {along(engine), along(engine), 0.1 * along(engine)};
  return points;
}

/// The point of a tree that is nearest to a place, by a search of the tree.
Index nearest_in(const PointTree& tree, const std::vector<Vec3d>& point, Vec3d place) {
  double nearest2 = std::numeric_limits<double>::max();
  Index found = -1;
  tree.search([&](std::size_t node) { return distance2(place, tree.box(node)); }, nearest2,
              [&](std::size_t k) {
                const Vec3d apart = point[tree.order()[k]] - place;
                if (dot(apart, apart) >= nearest2) return;
                nearest2 = dot(apart, apart);
                found = tree.order()[k];
              });
  return found;
}

TEST(PointTree, FindsTheNearestPointWherePointsAreAndWhereTheyGo) {
  for (const std::size_t n : {1, 2, 9, 700}) {
    std::vector<Vec3d> point = random_points(n, 3);
    PointTree tree(point);
    const std::vector<Vec3d> shift = random_points(n, 4);
    for (int moved = 0; moved < 2; ++moved) {
      for (const Vec3d& place : random_points(200, 5)) {
        const auto nearer = [&](Vec3d a, Vec3d b) { return norm(a - place) < norm(b - place); };
        const auto nearest = std::min_element(point.begin(), point.end(), nearer) - point.begin();
        EXPECT_EQ(nearest_in(tree, point, place), nearest);
      }
      for (std::size_t k = 0; k < n; ++k) point[k] += 0.3 * shift[k];
      tree.move_to(point);
    }
  }
  const PointTree none(std::vector<Vec3d>{});
  EXPECT_EQ(nearest_in(none, {}, {0, 0, 0}), -1);
}

/// A plate with parallel faces is as thick everywhere as they are apart, and two plates side by
/// side do not count as one: between them is no body.
TEST(Thicknesses, AreThoseOfPlates) {
  const double thick = 0.1, thin = 0.04, gap = 0.02;
  std::vector<Vec3d> place, normal;
  std::vector<double> expected;
  const auto add_face = [&](double z, double outward, double thickness) {
    for (double x = 0; x < 1; x += 0.02) {
      for (double y = 0; y < 1; y += 0.02) {
        place.push_back({x, y, z});
        normal.push_back({0, 0, outward});
        expected.push_back(thickness);
      }
    }
  };
  add_face(0, -1, thick);
  add_face(thick, 1, thick);
  add_face(thick + gap, -1, thin);
  add_face(thick + gap + thin, 1, thin);
  const std::vector<double> found = thicknesses(place, normal, 0.5);
  for (std::size_t k = 0; k < place.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-12);
  // Beyond the greatest distance nothing is found.
  const std::vector<double> near = thicknesses(place, normal, 0.05);
  for (std::size_t k = 0; k < place.size(); ++k) {
    EXPECT_EQ(std::isfinite(near[k]), expected[k] == thin);
  }
}

/// On a ball each point has its antipode on the other side, and points from there to where the
/// normals are no longer opposite; the nearest of these is 0.6 to 1 diameters away.
TEST(Thicknesses, OfABallAreNearlyItsDiameter) {
  std::vector<Vec3d> place, normal;
  for (const Vec3d& p : random_points(4000, 6)) {
    const double z = 2 * p.x - 1, angle = 2 * 3.14159265358979 * p.y, r = std::sqrt(1 - z * z);
    normal.push_back({r * std::cos(angle), r * std::sin(angle), z});
    place.push_back(normal.back());
  }
  const std::vector<double> found = thicknesses(place, normal, 4);
  // The angle between the normals is 127 degrees at least: 1 + 0.6 diameters along the normal.
  for (const double thickness : found) EXPECT_NEAR(thickness, 1.6, 0.06);
}

}  // namespace
}  // namespace phyxel
