/// Filling surfaces with phyxels: counts, positions, spacing, volumes, refusals.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include "mesh/nearest_points.hpp"
#include "mesh/winding_number.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

Cloud sampled(const Surface& surface, Index phyxels, SampleReport* report = nullptr) {
  return sample_surface(surface, {.phyxels = phyxels, .on_surface = false}, report);
}

std::string refusal(const Surface& surface, SampleRequest request = {.phyxels = 100}) {
  try {
    sample_surface(surface, request);
  } catch (const InputError& error) {
    return error.what();
  }
  return "not refused";
}

Vec3d random_point(std::mt19937_64& engine, double low, double high) {
  std::uniform_real_distribution<double> along(low, high);
  const double x = along(engine), y = along(engine), z = along(engine);
  return {x, y, z};
}

/// Distance from each point to the nearest other one, by all pairs.
std::vector<double> nearest_distances(const std::vector<Vec3d>& points) {
  std::vector<double> nearest(points.size(), HUGE_VAL);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double distance = norm(points[i] - points[j]);
      nearest[i] = std::min(nearest[i], distance);
      nearest[j] = std::min(nearest[j], distance);
    }
  }
  return nearest;
}

double sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

/// Of candidates at the same distance, the first is found.
TEST(Sample, NearestCandidatesAreThoseOfAllPairs) {
  std::mt19937_64 engine(3);
  const auto coordinates = [&](std::size_t n) {  // of a coarse grid, so that many are as near
    std::vector<float> values(3 * n);
    for (float& v : values) v = static_cast<float>(engine() % 5);
    return values;
  };
  for (const std::size_t n : {0u, 1u, 7u, 64u, 65u}) {
    const std::size_t m = 40;
    const std::vector<float> p = coordinates(n), q = coordinates(m);
    std::vector<float> distance2(n);
    std::vector<std::int32_t> nearest(n);
    find_nearest({n, p.data(), p.data() + n, p.data() + 2 * n},
                 {m, q.data(), q.data() + m, q.data() + 2 * m}, distance2.data(), nearest.data());
    for (std::size_t k = 0; k < n; ++k) {
      const auto distance = [&](std::size_t c) {
        return std::hypot(p[k] - q[c], p[n + k] - q[m + c], p[2 * n + k] - q[2 * m + c]);
      };
      std::size_t best = 0;
      for (std::size_t c = 1; c < m; ++c) {
        if (distance(c) < distance(best)) best = c;
      }
      EXPECT_EQ(nearest[k], static_cast<std::int32_t>(best));
    }
  }
}

TEST(Sample, CountIsExactAllAreInsideAndVolumesSumToTheEnclosedVolume) {
  const Surface ball = test::sphere({5, -2, 1}, 0.5, 4);
  const WindingNumber winding(ball);
  for (const Index n : {1, 2, 10, 575, 20000}) {
    SCOPED_TRACE(n);
    SampleReport report;
    const Cloud cloud = sample_surface(
        ball, {.phyxels = n, .relaxations = n < 1000 ? 30 : 3, .on_surface = false}, &report);
    ASSERT_EQ(cloud.position.size(), static_cast<std::size_t>(n));
    ASSERT_EQ(cloud.volume.size(), cloud.position.size());
    for (const Vec3d& p : cloud.position) ASSERT_GT(winding(p), 0.5);
    EXPECT_THAT(cloud.volume, Each(::testing::Gt(0.0)));
    EXPECT_NEAR(sum(cloud.volume), enclosed_volume(ball), 1e-12 * n);  // rounding of n terms
    EXPECT_DOUBLE_EQ(report.volume, enclosed_volume(ball));
    EXPECT_EQ(report.doubtful_fraction, 0.0);
    EXPECT_TRUE(report.warnings.empty());
  }
}

TEST(Sample, VerticesBecomeSurfels) {
  const Surface ball = test::sphere({0, 0, 0}, 1, 2);
  const Cloud cloud = sampled(ball, 50);
  EXPECT_EQ(cloud.surface.position, ball.position);
  EXPECT_EQ(cloud.surface.triangle, ball.triangle);
  ASSERT_EQ(cloud.surface.normal.size(), ball.position.size());
  // On a sphere normals are radial: within a quarter of the 0.4 radians between its vertices.
  for (std::size_t v = 0; v < ball.position.size(); ++v) {
    EXPECT_GT(dot(cloud.surface.normal[v], ball.position[v]), std::cos(0.1));
  }
}

TEST(Sample, PhyxelsAreSpreadEvenlyWithoutClumps) {
  const Index n = 4000;
  SampleReport report;
  const Cloud cloud = sampled(test::unit_cube(), n, &report);
  const std::vector<double> gap = nearest_distances(cloud.position);
  const double spacing = std::cbrt(1.0 / n), mean = sum(gap) / n;
  EXPECT_NEAR(report.spacing, mean, 1e-12);
  EXPECT_NEAR(report.smallest_gap, *std::min_element(gap.begin(), gap.end()), 1e-15);
  double variance = 0;
  for (const double g : gap) variance += (g / mean - 1) * (g / mean - 1) / n;
  // Uniform random points have a mean of 0.554 spacings, a deviation of 36% and no smallest gap;
  // the densest lattice has a mean of 1.12. Centroidal cells lie in between, close to the latter.
  EXPECT_GT(mean, 0.88 * spacing);
  EXPECT_LT(std::sqrt(variance), 0.1);
  EXPECT_GT(report.smallest_gap, 0.5 * mean);
  EXPECT_LT(*std::max_element(gap.begin(), gap.end()), 1.3 * mean);  // no lonely ones either

  // Boxes of eight of the cube's parts hold an eighth each, within the phyxels on their borders.
  std::array<int, 8> count{};
  for (const Vec3d& p : cloud.position) ++count[(p.x > 0.5) + 2 * (p.y > 0.5) + 4 * (p.z > 0.5)];
  for (const int c : count)
    EXPECT_NEAR(c, n / 8, 0.06 * n / 8);  // random points: one in three fails

  // Volumes are those of nearly equal cells.
  double volume_variance = 0;
  for (const double v : cloud.volume) volume_variance += (v * n - 1) * (v * n - 1) / n;
  EXPECT_LT(std::sqrt(volume_variance), 0.15);
}

TEST(Sample, WithoutRelaxationThereIsStillAGap) {
  SampleReport report;
  sample_surface(test::unit_cube(), {.phyxels = 3000, .relaxations = 0, .on_surface = false},
                 &report);
  // Darts leave at least 0.7 spacings before room runs out; random points come within 0.05.
  EXPECT_GT(report.smallest_gap, 0.6 * std::cbrt(1.0 / 3000));
}

TEST(Sample, VolumesAreTheSharesOfSpaceNearestToEachPhyxel) {
  const Cloud cloud = sampled(test::unit_cube(), 8);
  // Eight centroidal cells of a cube are its octants, or nearly.
  for (const double v : cloud.volume) EXPECT_NEAR(v, 0.125, 0.02);
  std::mt19937_64 engine(3);
  std::vector<double> hits(8, 0);
  const int n = 200000;
  for (int k = 0; k < n; ++k) {
    const Vec3d p = random_point(engine, 0, 1);
    std::size_t nearest = 0;
    for (std::size_t i = 1; i < 8; ++i) {
      if (norm(cloud.position[i] - p) < norm(cloud.position[nearest] - p)) nearest = i;
    }
    hits[nearest] += 1.0 / n;
  }
  // Five standard deviations of 200,000 draws.
  for (std::size_t i = 0; i < 8; ++i)
    EXPECT_NEAR(cloud.volume[i], hits[i], 5 * std::sqrt(0.11 / n));
}

TEST(Sample, ResultDependsOnTheSeedAndNotOnTheThreads) {
  const Surface ball = test::together(test::sphere({0, 0, 0}, 1, 3), test::unit_cube());
  const auto run = [&](std::uint64_t seed, int threads) {
    const int before = omp_get_max_threads();
    omp_set_num_threads(threads);
    Cloud cloud = sample_surface(ball, {.phyxels = 700, .seed = seed, .relaxations = 10});
    omp_set_num_threads(before);
    return cloud;
  };
  const Cloud one = run(4, 1), two = run(4, 2), three = run(4, 3), other = run(5, 1);
  EXPECT_EQ(one.position, two.position);
  EXPECT_EQ(one.volume, two.volume);
  EXPECT_EQ(one.position, three.position);
  EXPECT_EQ(one.volume, three.volume);
  EXPECT_NE(one.position, other.position);
}

TEST(Sample, SizeAndPlaceDoNotMatter) {
  // A power of two and a whole number: no coordinate is rounded, so the result is the same.
  const Cloud unit = sampled(test::unit_cube(), 100);
  for (const int exponent : {-60, 40}) {
    const double size = std::ldexp(1.0, exponent);
    SampleReport report;
    const Cloud scaled = sampled(test::box({0, 0, 0}, {size, size, size}), 100, &report);
    for (std::size_t i = 0; i < 100; ++i) EXPECT_EQ(scaled.position[i], size * unit.position[i]);
    EXPECT_DOUBLE_EQ(sum(scaled.volume), size * size * size);
    EXPECT_DOUBLE_EQ(report.volume, size * size * size);
    EXPECT_GT(report.smallest_gap, 0.1 * size);
  }
  const Cloud far = sampled(test::box({1e6, 1e6, 1e6}, {1e6 + 1, 1e6 + 1, 1e6 + 1}), 100);
  for (const Vec3d& p : far.position) {
    EXPECT_TRUE(p.x > 1e6 && p.x < 1e6 + 1 && p.y > 1e6 && p.y < 1e6 + 1 && p.z > 1e6 &&
                p.z < 1e6 + 1);
  }
}

TEST(Sample, PartsGetPhyxelsInProportion) {
  // 1 and 8 m^3, apart.
  const Surface two = test::together(test::unit_cube(), test::box({3, 0, 0}, {5, 2, 2}));
  SampleReport report;
  const Cloud cloud = sampled(two, 900, &report);
  const auto small =
      std::count_if(cloud.position.begin(), cloud.position.end(), [](Vec3d p) { return p.x < 2; });
  EXPECT_NEAR(static_cast<double>(small), 100, 15);  // phyxels fit on its surface, too
  EXPECT_EQ(report.defects.parts, 2);
  EXPECT_DOUBLE_EQ(report.volume, 9.0);
}

TEST(Sample, CavitiesStayEmpty) {
  const Surface hollow =
      test::together(test::sphere({0, 0, 0}, 1, 4), test::turned(test::sphere({0, 0, 0}, 0.8, 4)));
  SampleReport report;
  const Cloud cloud = sampled(hollow, 500, &report);
  EXPECT_DOUBLE_EQ(report.volume, enclosed_volume(hollow));
  for (const Vec3d& p : cloud.position) {
    // The inner sphere's faces cut at most 0.5% off its radius.
    EXPECT_TRUE(norm(p) > 0.8 * 0.995 && norm(p) < 1) << norm(p);
  }
  // Fewer phyxels than the shell is thick: centroids would lie in the cavity.
  for (const Vec3d& p : sampled(hollow, 1).position) EXPECT_GT(norm(p), 0.8 * 0.995);
}

TEST(Sample, ThinPlatesHoldAllTheirPhyxels) {
  const Surface plate = test::box({0, 0, 0}, {1, 1, 0.001});
  SampleReport report;
  const Cloud cloud = sampled(plate, 400, &report);
  for (const Vec3d& p : cloud.position) ASSERT_TRUE(p.z > 0 && p.z < 0.001);
  EXPECT_GT(report.smallest_gap, 0.5 / 20);  // spread in the plane, 1/20 apart
  EXPECT_NEAR(sum(cloud.volume), 0.001, 1e-15);
}

TEST(Sample, InsideOutSurfacesAreTurnedWithAWarning) {
  const Surface cube = test::unit_cube();
  SampleReport report;
  const Cloud cloud = sampled(test::turned(cube), 200, &report);
  EXPECT_TRUE(report.defects.inside_out);
  EXPECT_THAT(report.warnings, ::testing::ElementsAre(HasSubstr("inside out and has been turned")));
  EXPECT_EQ(cloud.position, sampled(cube, 200).position);
  EXPECT_DOUBLE_EQ(enclosed_volume(cloud.surface), 1.0);
  EXPECT_EQ(cloud.surface.normal, cube.normal);
}

TEST(Sample, TurnedTrianglesAndPartsAreSetRight) {
  Surface s = test::sphere({0, 0, 0}, 1, 3);
  const double volume = enclosed_volume(s);
  for (const std::size_t t : {3u, 50u, 51u}) std::swap(s.triangle[t][1], s.triangle[t][2]);
  SampleReport report;
  sampled(s, 100, &report);
  EXPECT_NEAR(report.volume, volume, 1e-12);
  EXPECT_THAT(report.warnings, ::testing::ElementsAre(HasSubstr("3 triangles were turned over")));

  const Surface mixed =
      test::together(test::unit_cube(), test::turned(test::box({3, 0, 0}, {4, 1, 1})));
  sampled(mixed, 100, &report);
  EXPECT_DOUBLE_EQ(report.volume, 2.0);
  EXPECT_THAT(report.warnings, ::testing::ElementsAre(HasSubstr("1 of 2 parts")));
}

TEST(Sample, OverlapsCountOnceAndAreReported) {
  // Two unit cubes that share a half: 1.5 m^3.
  const Surface two = test::together(test::unit_cube(), test::box({0.5, 0, 0}, {1.5, 1, 1}));
  SampleReport report;
  const Cloud cloud = sampled(two, 3000, &report);
  EXPECT_NEAR(report.volume, 1.5, 0.005);  // counted by samples: about a million
  EXPECT_NEAR(sum(cloud.volume), report.volume, 1e-10);
  EXPECT_THAT(report.warnings,
              ::testing::ElementsAre(HasSubstr("overlaps itself: 33% of the inside")));
  // As many in the half that both cover as in the others.
  const auto shared = std::count_if(cloud.position.begin(), cloud.position.end(),
                                    [](Vec3d p) { return p.x > 0.5 && p.x < 1; });
  EXPECT_NEAR(static_cast<double>(shared), 1000, 60);
}

TEST(Sample, SmallHolesAreBridgedAndReported) {
  const Surface ball = test::sphere({0, 0, 0}, 1, 4);
  SampleReport report;
  const Cloud cloud = sampled(test::without(ball, 100), 1000, &report);
  EXPECT_EQ(report.defects.open_edges, 3);
  for (const Vec3d& p : cloud.position) EXPECT_LT(norm(p), 1.0);
  // The missing triangle is a thousandth of the surface; the volume is counted by samples.
  EXPECT_NEAR(report.volume, enclosed_volume(ball), 0.005 * report.volume);
  EXPECT_LT(report.doubtful_fraction, 0.01);
  EXPECT_THAT(report.warnings, ::testing::ElementsAre(::testing::AllOf(HasSubstr("not closed"),
                                                                       HasSubstr("one is near"))));
}

TEST(Sample, UnusedVerticesAreNoSurfels) {
  Surface s = test::unit_cube();
  s.position.insert(s.position.begin(), {9, 9, 9});
  for (Triangle& t : s.triangle) t = {t[0] + 1, t[1] + 1, t[2] + 1};
  SampleReport report;
  const Cloud cloud = sampled(s, 10, &report);
  EXPECT_EQ(cloud.surface.position, test::unit_cube().position);
  EXPECT_EQ(cloud.surface.triangle, test::unit_cube().triangle);
  EXPECT_THAT(report.warnings,
              ::testing::ElementsAre(HasSubstr("1 vertices that no triangle uses")));
}

/// Distance to the nearest face of the unit cube, from inside.
double depth_in_cube(Vec3d p) { return std::min({p.x, p.y, p.z, 1 - p.x, 1 - p.y, 1 - p.z}); }

TEST(SampleOnSurface, CornersEdgesFacesAndInsideGetTheirShares) {
  const Index n = 2000;
  SampleReport report;
  const Cloud cloud =
      sample_surface(test::unit_cube(), {.phyxels = n, .on_surface = true}, &report);
  ASSERT_EQ(cloud.position.size(), static_cast<std::size_t>(n));
  EXPECT_NEAR(sum(cloud.volume), 1, 1e-12 * n);  // rounding of n terms
  EXPECT_TRUE(report.warnings.empty());

  // Kinds by the number of faces that a phyxel lies on, exactly as the faces lie across axes.
  std::array<int, 4> count{};
  std::array<double, 4> volume{};
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    const Vec3d p = cloud.position[i];
    int faces = 0;
    for (const double x : {p.x, p.y, p.z}) faces += x == 0 || x == 1;
    ++count[faces];
    volume[faces] += cloud.volume[i];
    // The others keep off: half a gap of those on faces.
    if (faces == 0) {
      EXPECT_GT(depth_in_cube(p), 0.4 * report.spacing);
    }
  }
  EXPECT_EQ(count[3], 8);
  EXPECT_EQ(report.on_surface, count[1] + count[2] + count[3]);
  // A lattice of as many nodes has 12.6 along an edge: 127 within the edges, 671 within the faces.
  EXPECT_NEAR(count[2], 127, 20);
  EXPECT_NEAR(count[1], 671, 70);
  // Nodes have halves of a cell on faces, quarters on edges, eighths in corners.
  const double inside = volume[0] / count[0];
  EXPECT_NEAR(volume[1] / count[1], inside / 2, 0.1 * inside);
  EXPECT_NEAR(volume[2] / count[2], inside / 4, 0.06 * inside);
  EXPECT_NEAR(volume[3] / count[3], inside / 8, 0.04 * inside);
  EXPECT_GT(report.smallest_gap, 0.5 * report.spacing);
}

/// An edge with a vertex in its middle that only one of its triangles uses; the triangle in between
/// is degenerate.
TEST(SampleOnSurface, EdgesAreFoundBesideTrianglesWithoutArea) {
  Surface cube = test::unit_cube();
  cube.position.push_back({0.5, 0, 0});
  cube.triangle[5] = {0, 5, 4};
  cube.triangle[4] = {8, 1, 5};  // of {0, 1, 5}, on y = 0
  cube.triangle.push_back({0, 8, 5});
  cube.triangle.push_back({0, 1, 8});  // the edge's own
  ASSERT_EQ(inspect_surface(cube).open_edges, 0);
  const Cloud cloud = sample_surface(cube, {.phyxels = 1000, .on_surface = true});
  int along = 0;
  for (const Vec3d& p : cloud.position) along += p.y == 0 && p.z == 0;
  // As many as along the other edges: 1,000 nodes have ten.
  EXPECT_GE(along, 8);
  EXPECT_THAT(cloud.position, ::testing::Contains(Vec3d{0, 0, 0}));
  EXPECT_THAT(cloud.position, ::testing::Contains(Vec3d{1, 0, 0}));
}

TEST(SampleOnSurface, CornersAreExactWhereverTheBodyLies) {
  for (const Vec3d low : {Vec3d{0.3, -0.7, 0.88}, Vec3d{-3.14159, 0.1, 1e-3}}) {
    const Vec3d high = low + Vec3d{0.61, 0.73, 0.59};
    const Surface box = test::box(low, high);
    const Cloud cloud = sample_surface(box, {.phyxels = 500, .on_surface = true});
    for (const Vec3d& corner : box.position) {
      EXPECT_THAT(cloud.position, ::testing::Contains(corner));
    }
    for (const Vec3d& p : cloud.position) {
      EXPECT_TRUE(p.x >= low.x && p.x <= high.x && p.z >= low.z && p.z <= high.z) << p.x;
    }
  }
}

TEST(SampleOnSurface, RoundBodiesHaveNoCornersAndKeepTheirSurface) {
  const Surface ball = test::sphere({0, 0, 0}, 1, 4);
  SampleReport report;
  const Cloud cloud = sample_surface(ball, {.phyxels = 1000, .on_surface = true}, &report);
  Index outer = 0;
  double flattest = 1;
  for (const Triangle& t : ball.triangle) {
    flattest = std::min(flattest,
                        norm(ball.position[t[0]] + ball.position[t[1]] + ball.position[t[2]]) / 3);
  }
  for (const Vec3d& p : cloud.position) {
    EXPECT_LT(norm(p), 1 + 1e-7);
    outer += norm(p) > flattest - 1e-7;
  }
  EXPECT_EQ(outer, report.on_surface);
  // Spheres of 1,000 phyxels have radii of 6.2 spacings: 4 pi r^2 of one on each spacing squared.
  EXPECT_NEAR(report.on_surface, 440, 50);
  EXPECT_NEAR(sum(cloud.volume), enclosed_volume(ball), 1e-9);
}

TEST(SampleOnSurface, DoesNotDependOnThreadsAndServesParts) {
  const Surface two = test::together(test::sphere({3, 0, 0}, 1, 3), test::unit_cube());
  const auto run = [&](int threads) {
    const int before = omp_get_max_threads();
    omp_set_num_threads(threads);
    Cloud cloud = sample_surface(two, {.phyxels = 1500, .relaxations = 10, .on_surface = true});
    omp_set_num_threads(before);
    return cloud;
  };
  const Cloud one = run(1), three = run(3);
  EXPECT_EQ(one.position, three.position);
  EXPECT_EQ(one.volume, three.volume);
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p{corner & 1 ? 1.0 : 0.0, corner & 2 ? 1.0 : 0.0, corner & 4 ? 1.0 : 0.0};
    EXPECT_THAT(one.position, ::testing::Contains(p));
  }
}

TEST(SampleOnSurface, IsChosenWhereTheSurfaceAllowsIt) {
  SampleReport report;
  const auto on_surface = [&](const Surface& surface, Index phyxels) {
    sample_surface(surface, {.phyxels = phyxels, .relaxations = 2}, &report);
    return report.on_surface;
  };
  EXPECT_GT(on_surface(test::unit_cube(), 500), 250);
  EXPECT_TRUE(report.warnings.empty());
  EXPECT_EQ(on_surface(test::box({0, 0, 0}, {1, 1, 0.001}), 400), 0);
  EXPECT_THAT(report.warnings,
              ::testing::ElementsAre(HasSubstr("all phyxels lie inside: 400 phyxels are too few")));
  EXPECT_EQ(on_surface(test::without(test::sphere({0, 0, 0}, 1, 4), 100), 500), 0);
  EXPECT_EQ(on_surface(test::together(test::unit_cube(), test::box({0.5, 0, 0}, {1.5, 1, 1})), 500),
            0);
}

TEST(SampleOnSurface, IsRefusedWhereTheSurfaceDoesNotAllowIt) {
  const SampleRequest request{.phyxels = 400, .on_surface = true};
  EXPECT_THAT(refusal(test::box({0, 0, 0}, {1, 1, 0.001}), request),
              HasSubstr("400 phyxels are too few for some to lie on the surface"));
  EXPECT_THAT(refusal(test::unit_cube(), {.phyxels = 5, .on_surface = true}),
              HasSubstr("5 phyxels are too few"));
  EXPECT_THAT(refusal(test::without(test::sphere({0, 0, 0}, 1, 4), 100), request),
              HasSubstr("the surface is not closed (1 part, 3 open edges"));
  EXPECT_THAT(
      refusal(test::together(test::unit_cube(), test::box({0.5, 0, 0}, {1.5, 1, 1})), request),
      HasSubstr("the surface overlaps itself"));
}

TEST(Sample, RequestsOutOfRangeAreRefused) {
  const Surface cube = test::unit_cube();
  EXPECT_THAT(refusal(cube, {.phyxels = 0}), HasSubstr("0 phyxels asked for; at least 1"));
  EXPECT_THAT(refusal(cube, {.phyxels = -3}), HasSubstr("-3 phyxels asked for"));
  EXPECT_THAT(refusal(cube, {.phyxels = 5, .relaxations = -1}), HasSubstr("-1 relaxations"));
  EXPECT_THAT(refusal(cube, {.phyxels = 2'000'000'000}), HasSubstr("GiB of memory"));
}

TEST(Sample, SurfacesWithoutInsideAreRefused) {
  const Surface cube = test::unit_cube();
  EXPECT_THAT(refusal({}), HasSubstr("no triangles"));

  Surface s = cube;
  s.position[3].y = std::nan("");
  EXPECT_THAT(refusal(s), HasSubstr("vertex 3 of the surface is at [1, nan, 0]; allowed: finite"));
  s = cube;
  s.triangle[7][1] = 8;
  EXPECT_THAT(refusal(s), HasSubstr("triangle 7 of the surface names vertex 8; allowed: 0 to 7"));

  Surface sheet = cube;
  sheet.triangle.resize(2);
  EXPECT_THAT(refusal(sheet), HasSubstr("encloses no volume"));
  EXPECT_THAT(refusal(sheet), HasSubstr("open edges"));
  const Surface two_sided = test::together(sheet, test::turned(sheet));
  EXPECT_THAT(refusal(two_sided), HasSubstr("encloses no volume"));
  EXPECT_THAT(refusal(test::box({0, 0, 0}, {1, 1, 0})), HasSubstr("encloses no volume"));
  EXPECT_THAT(refusal(test::box({0, 0, 0}, {1, 0, 0})), HasSubstr("encloses no volume"));
  EXPECT_THAT(refusal(test::box({2, 2, 2}, {2, 2, 2})), HasSubstr("the surface is 0 m across"));
  EXPECT_THAT(refusal(test::box({1e9, 0, 0}, {1e9 + 0.5, 0.5, 0.5})), HasSubstr("too few digits"));

  // A bowl: half of a sphere.
  Surface bowl = test::sphere({0, 0, 0}, 1, 4);
  std::erase_if(bowl.triangle, [&](const Triangle& t) {
    return bowl.position[t[0]].z + bowl.position[t[1]].z + bowl.position[t[2]].z > 0;
  });
  EXPECT_THAT(refusal(bowl), HasSubstr("too open to tell inside from outside"));
  EXPECT_THAT(refusal(bowl), HasSubstr("open edges"));
}

}  // namespace
}  // namespace phyxel
