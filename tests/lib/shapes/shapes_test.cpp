/// Lattice shapes: counts, volumes, surfaces, regions and refusals.
#include "phyxel/shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>

#include "phyxel/error.hpp"
#include "support/surface_checks.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using std::numbers::pi;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double rounding = 1e-12;  // relative: sums of up to 1e5 equal terms

ShapeRequest beam() {
  return {.name = "beam", .size = {2, 0.3, 0.4}, .spacing = 0.05, .jitter = 0.5, .seed = 7};
}
ShapeRequest block() {
  return {.name = "block", .size = {1, 0.6, 0.8}, .spacing = 0.04, .jitter = 0.5, .seed = 7};
}
ShapeRequest cylinder() {
  return {
      .name = "cylinder", .radius = 0.5, .length = 1.5, .spacing = 0.05, .jitter = 0.5, .seed = 7};
}
ShapeRequest sphere() {
  return {.name = "sphere", .radius = 0.5, .spacing = 0.04, .jitter = 0.5, .seed = 7};
}

double sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

std::string message_of(const ShapeRequest& request) {
  try {
    make_shape(request);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Shapes, BoxesHoldTheProductOfTheirCounts) {
  EXPECT_EQ(make_shape(beam()).position.size(), 40u * 6 * 8);
  EXPECT_EQ(make_shape(block()).position.size(), 25u * 15 * 20);
}

TEST(Shapes, BoxCellsTileWhenTheSpacingDoesNotDivideTheSize) {
  ShapeRequest request{.name = "beam", .size = {1, 0.35, 0.1}, .spacing = 0.15};
  const Cloud cloud = make_shape(request);  // 6.67, 2.33 and 0.67 spacings
  EXPECT_EQ(cloud.position.size(), 7u * 2 * 1);
  double nearest_end = 1;
  for (const Vec3d& p : cloud.position) nearest_end = std::min(nearest_end, p.x);
  EXPECT_NEAR(nearest_end, 0.5 / 7, rounding);
  EXPECT_NEAR(sum(cloud.volume), 0.035, 0.035 * rounding);
}

TEST(Shapes, VolumesSumToThatOfTheSolid) {
  EXPECT_NEAR(sum(make_shape(beam()).volume), 0.24, 0.24 * rounding);
  EXPECT_NEAR(sum(make_shape(block()).volume), 0.48, 0.48 * rounding);
  EXPECT_NEAR(sum(make_shape(cylinder()).volume), pi * 0.375, pi * 0.375 * rounding);
  EXPECT_NEAR(sum(make_shape(sphere()).volume), pi / 6, pi / 6 * rounding);
}

TEST(Shapes, CountsOfRoundSolidsFollowTheirVolume) {
  // A cell is in or out by its centre: off by a fraction of the cells on the surface.
  EXPECT_NEAR(static_cast<double>(make_shape(cylinder()).position.size()), pi * 0.375 / 1.25e-4,
              150);
  EXPECT_NEAR(static_cast<double>(make_shape(sphere()).position.size()), pi / 6 / 6.4e-5, 150);
}

TEST(Shapes, JitteredPhyxelsStayInside) {
  for (const Vec3d& p : make_shape(beam()).position) {
    EXPECT_TRUE(p.x > 0 && p.x < 2 && std::abs(p.y) < 0.15 && std::abs(p.z) < 0.2);
  }
  for (const Vec3d& p : make_shape(block()).position) {
    EXPECT_TRUE(std::abs(p.x) < 0.5 && std::abs(p.y) < 0.3 && std::abs(p.z) < 0.4);
  }
  for (const Vec3d& p : make_shape(cylinder()).position) {
    EXPECT_TRUE(std::hypot(p.x, p.y) < 0.5 && std::abs(p.z) < 0.75);
  }
  for (const Vec3d& p : make_shape(sphere()).position) EXPECT_LT(norm(p), 0.5);
}

TEST(Shapes, JitterMovesEachPhyxelByUpToItsFraction) {
  for (ShapeRequest request : {beam(), block(), cylinder(), sphere()}) {
    request.jitter = 0;
    const Cloud regular = make_shape(request);
    request.jitter = 0.3;
    const Cloud moved = make_shape(request);
    ASSERT_EQ(moved.position.size(), regular.position.size());
    double largest = 0;
    for (std::size_t i = 0; i < moved.position.size(); ++i) {
      const Vec3d d = moved.position[i] - regular.position[i];
      largest = std::max({largest, std::abs(d.x), std::abs(d.y), std::abs(d.z)});
    }
    const double limit = 0.3 * request.spacing;
    EXPECT_LE(largest, limit * (1 + 1e-9));  // cells are the spacing to rounding here
    EXPECT_GT(largest, 0.99 * limit);        // of thousands, some move nearly all the way
  }
}

TEST(Shapes, JitterIsEvenAndIndependentInTheThreeDirections) {
  ShapeRequest request = block();
  const Cloud moved = make_shape(request);
  request.jitter = 0;
  const Cloud regular = make_shape(request);
  const double n = static_cast<double>(moved.position.size()), limit = 0.5 * request.spacing;
  Vec3d mean, square, product;
  for (std::size_t i = 0; i < moved.position.size(); ++i) {
    const Vec3d d = (moved.position[i] - regular.position[i]) / limit;
    mean += d / n;
    square += Vec3d{d.x * d.x, d.y * d.y, d.z * d.z} / n;
    product += Vec3d{d.x * d.y, d.y * d.z, d.z * d.x} / n;
  }
  // Uniform in (-1, 1): variance 1/3. Five standard deviations of means over 7500 phyxels.
  for (double Vec3d::*axis : {&Vec3d::x, &Vec3d::y, &Vec3d::z}) {
    EXPECT_NEAR(mean.*axis, 0, 5 * std::sqrt(1 / (3 * n)));
    EXPECT_NEAR(square.*axis, 1.0 / 3, 5 * std::sqrt(4 / (45 * n)));
    EXPECT_NEAR(product.*axis, 0, 5 / (3 * std::sqrt(n)));
  }
}

TEST(Shapes, JitterDependsOnTheSeedAndNotOnThreads) {
  for (const ShapeRequest& request : {block(), sphere()}) {
    const int threads = omp_get_max_threads();
    omp_set_num_threads(1);
    const Cloud one = make_shape(request);
    omp_set_num_threads(2);
    const Cloud two = make_shape(request);
    omp_set_num_threads(threads);
    EXPECT_TRUE(one.position == two.position);
    EXPECT_EQ(one.volume, two.volume);
    EXPECT_EQ(one.regions, two.regions);
    ShapeRequest other = request;
    other.seed = 8;
    EXPECT_FALSE(make_shape(other).position == one.position);
  }
}

TEST(Shapes, NeighboursInSpaceAreNeighboursInMemory) {
  ShapeRequest request = block();
  request.size = {1.28, 1.28, 1.28};  // 32 cells each way
  const Cloud cloud = make_shape(request);
  // Any 512 phyxels in a row at a multiple of 512 fill a cube of 8 cells.
  for (std::size_t first = 0; first < cloud.position.size(); first += 512) {
    Vec3d low = cloud.position[first], high = low;
    for (std::size_t i = first; i < first + 512; ++i) {
      const Vec3d p = cloud.position[i];
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    EXPECT_LE(std::max({high.x - low.x, high.y - low.y, high.z - low.z}), 8 * 0.04 + rounding);
  }
}

/// Checks that a region has exactly the phyxels whose coordinate is in the outermost cell.
void expect_layer(const Cloud& cloud, const std::string& name, double Vec3d::*axis, double from,
                  double to) {
  std::vector<Index> expected;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    const double x = cloud.position[i].*axis;
    if (x > from && x < to) expected.push_back(static_cast<Index>(i));
  }
  ASSERT_TRUE(cloud.regions.contains(name)) << name;
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(cloud.regions.at(name), expected) << name;
}

TEST(Shapes, RegionsAreTheOutermostLayers) {
  ShapeRequest request = beam();
  request.jitter = 0.4;  // phyxels of two layers stay apart
  const Cloud bar = make_shape(request);
  expect_layer(bar, "x-", &Vec3d::x, 0, 0.05);
  expect_layer(bar, "x+", &Vec3d::x, 1.95, 2);
  expect_layer(bar, "y-", &Vec3d::y, -0.15, -0.10);
  expect_layer(bar, "y+", &Vec3d::y, 0.10, 0.15);
  expect_layer(bar, "z-", &Vec3d::z, -0.20, -0.15);
  expect_layer(bar, "z+", &Vec3d::z, 0.15, 0.20);
  EXPECT_EQ(bar.regions.size(), 6u);
  const Cloud rod = make_shape(cylinder());
  expect_layer(rod, "z-", &Vec3d::z, -0.75, -0.70);
  expect_layer(rod, "z+", &Vec3d::z, 0.70, 0.75);
  EXPECT_EQ(rod.regions.size(), 2u);
}

TEST(Shapes, SurfacesOfBoxesAreExact) {
  for (const auto& [request, volume] : {std::pair{beam(), 0.24}, std::pair{block(), 0.48}}) {
    const Surface surface = make_shape(request).surface;
    expect_closed_ball(surface);
    EXPECT_NEAR(enclosed_volume(surface), volume, volume * 1e-10);  // sums of 1e4 terms
  }
  const Surface bar = make_shape(beam()).surface;
  EXPECT_EQ(bar.position.size(), 2u * (40 * 6 + 40 * 8 + 6 * 8) + 2);  // quads + 2, by Euler
}

/// The sum of the area vectors of triangles, and of their areas [m²].
std::pair<Vec3d, double> area_of(const Surface& surface, const std::vector<Index>& triangles) {
  Vec3d sum;
  double area = 0;
  for (const Index t : triangles) {
    const auto [a, b, c] = surface.triangle[t];
    const Vec3d one = 0.5 * cross(surface.position[b] - surface.position[a],
                                  surface.position[c] - surface.position[a]);
    sum += one;
    area += norm(one);
  }
  return {sum, area};
}

TEST(Shapes, SidesAreGroupsOfTriangles) {
  const Surface box = make_shape({.name = "beam", .size = {1, 0.2, 0.3}, .spacing = 0.05}).surface;
  ASSERT_EQ(box.groups.size(), 6U);
  const Vec3d areas{0.2 * 0.3, 0.3 * 1, 1 * 0.2};
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const std::string name = std::string(1, "xyz"[axis]) + (sign < 0 ? "-" : "+");
      const auto [sum, area] = area_of(box, box.groups.at(name));
      Vec3d expected;
      (axis == 0   ? expected.x
       : axis == 1 ? expected.y
                   : expected.z) = sign * (axis == 0   ? areas.x
                                           : axis == 1 ? areas.y
                                                       : areas.z);
      EXPECT_LT(norm(sum - expected), 1e-12) << name;
      EXPECT_NEAR(area, norm(expected), 1e-12) << name;
    }
  }
  const Surface can =
      make_shape({.name = "cylinder", .radius = 0.5, .length = 2, .spacing = 0.05}).surface;
  ASSERT_EQ(can.groups.size(), 3U);
  std::size_t triangles = 0;
  for (const auto& [name, group] : can.groups) triangles += group.size();
  EXPECT_EQ(triangles, can.triangle.size());
  // Polygons of 64 corners or so in place of circles.
  EXPECT_NEAR(area_of(can, can.groups.at("z+")).first.z, std::numbers::pi / 4, 2e-3);
  EXPECT_NEAR(area_of(can, can.groups.at("z-")).first.z, -std::numbers::pi / 4, 2e-3);
  EXPECT_NEAR(area_of(can, can.groups.at("side")).second, 2 * std::numbers::pi, 1e-2);
  EXPECT_LT(norm(area_of(can, can.groups.at("side")).first), 1e-12);
  EXPECT_TRUE(make_shape({.name = "sphere", .radius = 1, .spacing = 0.2}).surface.groups.empty());
}

TEST(Shapes, SurfacesOfRoundSolidsHaveTheirVerticesOnThem) {
  const Surface ball = make_shape(sphere()).surface;
  expect_closed_ball(ball);
  for (std::size_t s = 0; s < ball.position.size(); ++s) {
    EXPECT_NEAR(norm(ball.position[s]), 0.5, rounding);
    EXPECT_GT(dot(ball.normal[s], ball.position[s]), 0.499);
  }
  // Facets with edges e cut off 3/8 (e / radius)^2 of a sphere, and 1/6 (e / radius)^2 of a
  // cylinder.
  EXPECT_LT(enclosed_volume(ball), pi / 6);
  EXPECT_NEAR(enclosed_volume(ball), pi / 6, pi / 6 * 0.5 * 0.0064);

  const Surface rod = make_shape(cylinder()).surface;
  expect_closed_ball(rod);
  for (const Vec3d& p : rod.position) {
    const double r = std::hypot(p.x, p.y);
    EXPECT_TRUE(std::abs(r - 0.5) < rounding || std::abs(std::abs(p.z) - 0.75) < rounding);
    EXPECT_TRUE(r < 0.5 + rounding && std::abs(p.z) < 0.75 + rounding);
  }
  EXPECT_NEAR(enclosed_volume(rod), pi * 0.375, pi * 0.375 * 0.25 * 0.01);
  EXPECT_GT(worst_triangle(rod), 0.05);
}

TEST(Shapes, LargeBodiesHaveAboutAMillionSurfelsAtMost) {
  // A sheet of a million phyxels, whose two sides would have two million surfels.
  ShapeRequest request{.name = "block", .size = {1, 1, 0.001}, .spacing = 0.001};
  EXPECT_LT(make_shape(request).surface.position.size(), 1'100'000u);
  request.surface = false;
  EXPECT_TRUE(make_shape(request).surface.position.empty());
}

TEST(Shapes, TheSpacingGivesTheCountAskedFor) {
  for (ShapeRequest request : {beam(), block(), cylinder(), sphere()}) {
    for (const Index wanted : {1, 2, 30, 1000, 50000}) {
      request.spacing = spacing_for(request, wanted);
      const auto found = static_cast<double>(make_shape(request).position.size());
      if (wanted >= 1000) {
        // One layer more or less on one axis: 3 to 8% of 1000 to 50,000 here, half of that missed.
        EXPECT_NEAR(found, wanted, 0.15 * wanted) << request.name;
      } else {
        EXPECT_GE(found, 1) << request.name;
        EXPECT_LE(found, 4 * wanted) << request.name;
      }
    }
  }
  ShapeRequest cube{.name = "block", .size = {1, 1, 1}};
  EXPECT_NEAR(spacing_for(cube, 1000), 0.1, rounding);
  EXPECT_NEAR(spacing_for(cube, 1), 1, rounding);
}

/// Nodes fill the box up to its faces, and their volumes sum to that of the box.
TEST(Shapes, NodesLieOnFacesEdgesAndCorners) {
  ShapeRequest request = beam();
  request.size = {2, 0.5, 0.25};
  request.spacing = 0.0625;
  request.placement = ShapeRequest::Placement::nodes;
  for (const double jitter : {0.0, 0.5}) {
    request.jitter = jitter;
    const Cloud cloud = make_shape(request);
    ASSERT_EQ(cloud.position.size(), 33u * 9 * 5);
    double volume = 0;
    std::map<double, int> shares;
    for (std::size_t i = 0; i < cloud.position.size(); ++i) {
      const Vec3d p = cloud.position[i];
      volume += cloud.volume[i];
      ++shares[cloud.volume[i] / (0.0625 * 0.0625 * 0.0625)];
      const int faces = (p.x == 0 || p.x == 2) + (std::abs(p.y) == 0.25) + (std::abs(p.z) == 0.125);
      EXPECT_EQ(cloud.volume[i], std::ldexp(0.0625 * 0.0625 * 0.0625, -faces));
      EXPECT_TRUE(p.x >= 0 && p.x <= 2 && std::abs(p.y) <= 0.25 && std::abs(p.z) <= 0.125);
    }
    EXPECT_NEAR(volume, 0.25, rounding);
    EXPECT_EQ(shares[0.125], 8);                // corners
    EXPECT_EQ(shares[0.25], 4 * (31 + 7 + 3));  // edges
    EXPECT_EQ(shares[1], 31 * 7 * 3);           // inside
    for (const Index i : cloud.regions.at("x-")) EXPECT_EQ(cloud.position[i].x, 0);
    for (const Index i : cloud.regions.at("z+")) EXPECT_EQ(cloud.position[i].z, 0.125);
    EXPECT_EQ(cloud.regions.at("x-").size(), 45u);
    EXPECT_EQ(cloud.regions.at("z+").size(), 33u * 9);
  }
  EXPECT_NEAR(spacing_for(request, 33 * 9 * 5), 0.0625, 0.003);
  ShapeRequest ball = sphere();
  ball.placement = ShapeRequest::Placement::nodes;
  EXPECT_THAT(message_of(ball), AllOf(HasSubstr("nodes"), HasSubstr("beam, block and cylinder")));
  EXPECT_THROW(spacing_for(ball, 1000), InputError);
}

// --- Refusals -----------------------------------------------------------------------------------

TEST(Shapes, UnknownNamesAreAnsweredWithTheNearest) {
  EXPECT_THAT(message_of({.name = "cilinder"}),
              AllOf(HasSubstr("cilinder"), HasSubstr("did you mean \"cylinder\"")));
  EXPECT_THAT(message_of({.name = ""}), HasSubstr("known are beam, block"));
  EXPECT_THROW(spacing_for({.name = "torus"}, 10), InputError);
  EXPECT_THROW(spacing_for({.name = "dino"}, 10), InputError);
}

TEST(Shapes, SizesSpacingAndJitterOutOfRangeAreNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {0.0, -1.0, nan, infinity}) {
    ShapeRequest request = beam();
    request.size.y = bad;
    EXPECT_THAT(message_of(request), AllOf(HasSubstr("beam"), HasSubstr("size.y"))) << bad;
    EXPECT_THROW(spacing_for(request, 10), InputError);
    request = cylinder();
    request.length = bad;
    EXPECT_THAT(message_of(request), HasSubstr("length")) << bad;
    request = sphere();
    request.radius = bad;
    EXPECT_THAT(message_of(request), HasSubstr("radius")) << bad;
    request = sphere();
    request.spacing = bad;
    EXPECT_THAT(message_of(request), HasSubstr("spacing")) << bad;
  }
  for (const double bad : {-0.1, 0.51, nan}) {
    ShapeRequest request = block();
    request.jitter = bad;
    EXPECT_THAT(message_of(request), AllOf(HasSubstr("jitter"), HasSubstr("0 to 0.5"))) << bad;
  }
  ShapeRequest tiny = block();
  tiny.size = {1e-150, 1e-150, 1e-150};
  tiny.spacing = 1e-151;
  EXPECT_THAT(message_of(tiny), HasSubstr("volume"));
}

TEST(Shapes, ASpacingLargerThanTheShapeIsRefused) {
  ShapeRequest request = beam();
  request.spacing = 2.1;
  EXPECT_THAT(message_of(request), AllOf(HasSubstr("2.1"), HasSubstr("at most 2 m")));
  request.spacing = 2;  // a single phyxel
  EXPECT_EQ(make_shape(request).position.size(), 1u);
  request = sphere();
  request.spacing = 1.01;
  EXPECT_THAT(message_of(request), HasSubstr("larger than the whole shape"));
}

TEST(Shapes, MorePhyxelsThanMemoryAreRefused) {
  for (ShapeRequest request : {beam(), block(), cylinder(), sphere()}) {
    for (const double spacing : {1e-5, 1e-12, 1e-300}) {  // the last: more than a double can count
      request.spacing = spacing;
      EXPECT_THAT(message_of(request), AllOf(HasSubstr("memory"), HasSubstr("phyxels")));
    }
  }
  ShapeRequest exact = block();
  exact.size = {1, 1, 1};
  exact.spacing = 1e-5;
  EXPECT_THAT(message_of(exact), HasSubstr("1000000000000000 phyxels"));
}

}  // namespace
}  // namespace phyxel
