/// Searches in clouds whose spacings vary, against brute force.
#include "model/graded_hash.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "model/assembly.hpp"
#include "model/neighbour_search.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// Points in a cube, and as many in one of an eighth of its side inside it.
std::vector<Vec3d> clustered_points(int n) {
  std::mt19937_64 engine(5);
  std::vector<Vec3d> points;
  for (int i = 0; i < n; ++i) {
    const Vec3d p = uniform_vector(engine, 1);
    points.push_back(i % 2 ? p : 0.125 * p + Vec3d{0.5, 0.2, -0.3});
  }
  return points;
}

std::pair<double, Index> nearest_by_brute_force(const std::vector<Vec3d>& points, Vec3d place,
                                                Index except) {
  std::pair<double, Index> found{HUGE_VAL, -1};
  for (Index i = 0; i < static_cast<Index>(points.size()); ++i) {
    const Vec3d d = points[i] - place;
    if (i != except) found = std::min(found, {dot(d, d), i});
  }
  return found;
}

TEST(GradedHash, ABallHoldsEachPointWithinTheRadiusOfItsOctaveOnce) {
  const Cloud cloud = graded(14);
  const GradedHash hash(cloud.position, cloud.spacing);
  EXPECT_GE(hash.octaves(), 4U);
  for (const double factor : {0.5, 2.0, 40.0}) {
    for (std::size_t at = 0; at < cloud.position.size(); at += 97) {
      std::vector<int> visits(cloud.position.size(), 0);
      hash.visit_ball(
          cloud.position[at], [&](double largest) { return factor * largest; },
          [&](const GradedHash::Entry& entry) {
            ++visits[entry.index];
            EXPECT_EQ(entry.position, cloud.position[entry.index]);
          });
      for (std::size_t i = 0; i < visits.size(); ++i) {
        const double r = norm(cloud.position[i] - cloud.position[at]);
        EXPECT_LE(visits[i], 1);
        if (r <= factor * cloud.spacing[i]) {
          EXPECT_EQ(visits[i], 1);
        }
      }
    }
  }
}

TEST(GradedHash, FindsTheNearestPointNearAndFar) {
  const std::vector<Vec3d> points = clustered_points(3000);
  const GradedHash hash(points, local_sizes(points));
  std::mt19937_64 engine(6);
  for (int k = 0; k < 200; ++k) {
    const Vec3d place = uniform_vector(engine, k % 2 ? 1.5 : 50);
    EXPECT_EQ(hash.nearest(place).index, nearest_by_brute_force(points, place, -1).second);
    const Index i = 7 * k;
    EXPECT_EQ(hash.nearest(points[i], HUGE_VAL, i).index,
              nearest_by_brute_force(points, points[i], i).second);
  }
  EXPECT_EQ(GradedHash({}, {}).nearest({}).index, -1);
}

TEST(GradedHash, MeanSpacingsOfGradedCloudsEqualBruteForce) {
  const std::vector<Vec3d> points = clustered_points(6000);
  const std::vector<double> spacing = mean_spacing(points, 10);
  for (std::size_t i = 0; i < points.size(); i += 53) {
    std::vector<double> distance;
    for (const Vec3d& p : points) distance.push_back(dot(p - points[i], p - points[i]));
    std::sort(distance.begin(), distance.end());
    double sum = 0;
    for (int k = 1; k <= 10; ++k) sum += std::sqrt(distance[k]);
    EXPECT_EQ(spacing[i], sum / 10);
  }
}

TEST(GradedHash, SizesFollowTheDensity) {
  const Cloud cloud = graded(20);
  const std::vector<double> size = local_sizes(cloud.position);
  std::vector<double> ratio;
  for (std::size_t i = 0; i < size.size(); ++i) ratio.push_back(size[i] / cloud.spacing[i]);
  std::sort(ratio.begin(), ratio.end());
  EXPECT_LT(ratio[ratio.size() * 95 / 100], 4 * ratio[ratio.size() * 5 / 100]);
}

TEST(GradedHash, ListsOfPairsAreSymmetricAndEqualBruteForce) {
  const Cloud cloud = graded(14);
  NeighbourhoodRule rule;
  rule.support = NeighbourhoodRule::Support::pairwise;
  const Neighbourhood hood = find_neighbours(
      cloud.position, graded_spacing(mean_spacing(cloud.position, 10), cloud.spacing), rule);
  EXPECT_TRUE(hood.symmetric);
  const auto n = static_cast<Index>(cloud.position.size());
  for (Index i = 0; i < n; ++i) {
    std::vector<Index> row;
    for (Index j = 0; j < n; ++j) {
      const Vec3d x = cloud.position[j] - cloud.position[i];
      const double h = pair_support(hood.support[i], hood.support[j]);
      if (j != i && dot(x, x) < h * h) row.push_back(j);
    }
    const auto found = hood.neighbours.row(i);
    EXPECT_EQ(std::vector<Index>(found.begin(), found.end()), row) << i;
  }
  const Csr transposed = transpose(hood.neighbours, n);
  EXPECT_EQ(transposed.indices, hood.neighbours.indices);
  EXPECT_EQ(transposed.offsets, hood.neighbours.offsets);
}

TEST(GradedClouds, SpacingsTravelWithTheirPhyxels) {
  Cloud cloud = graded(6);
  const auto spacing_by_place = [](const Cloud& c, double scale) {
    std::map<double, double> found;
    for (std::size_t i = 0; i < c.position.size(); ++i) {
      found[c.position[i].x / scale] = c.spacing[i] / scale;
    }
    return found;
  };
  const auto expected = spacing_by_place(cloud, 1);
  order_along_curve(cloud);
  EXPECT_EQ(spacing_by_place(cloud, 1), expected);
  Scene scene = one_body();
  scene.bodies[0].source.cloud = "graded";
  scene.bodies[0].scale = 4;
  scene.bodies.push_back(scene.bodies[0]);
  for (const Cloud& placed : make_clouds(scene, {{"graded", cloud}})) {
    EXPECT_EQ(spacing_by_place(placed, 4), expected);
  }
}

/// Supports follow the cloud's spacings, scaled to the mean distances, and not the place of a
/// phyxel at the surface; a scene may ask for one support all the same.
TEST(GradedClouds, SupportsFollowTheirSpacings) {
  const Cloud cloud = graded(10);
  const Model model = model_of(one_body(), cloud);
  const std::vector<double>& support = model.neighbourhood.support;
  const double ratio = support[0] / cloud.spacing[0];
  for (std::size_t i = 0; i < support.size(); ++i) {
    EXPECT_NEAR(support[i] / cloud.spacing[i], ratio, 1e-12 * ratio);
  }
  EXPECT_EQ(model.parts[0].pair_length, median_of(support));
  EXPECT_EQ(model.parts[0].neighbourhood.substr(0, 8), "pairwise");
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::uniform;
  EXPECT_EQ(model_of(scene, cloud).parts[0].pair_length, 0);
  scene.bodies[0].neighbourhood = {};
  scene.bodies[0].neighbourhood.radius = 0.2;
  EXPECT_EQ(model_of(scene, cloud).neighbourhood.support[5], 0.2);
}

TEST(GradedClouds, HaveTheirListsMadeOnTheHost) {
  BodyRequest request = one_body().bodies[0];
  request.closure = 0;
  EXPECT_FALSE(needs_lists_on_host(request, lattice(3, 3, 3, 0.1)));
  EXPECT_TRUE(needs_lists_on_host(request, graded(3)));
  request.neighbourhood.support = NeighbourhoodRule::Support::uniform;
  EXPECT_FALSE(needs_lists_on_host(request, graded(3)));
}

}  // namespace
}  // namespace phyxel
