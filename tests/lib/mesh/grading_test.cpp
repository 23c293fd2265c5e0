/// Bodies whose phyxels are nearer to each other in some places than in others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <thread>

#include "mesh/repulsion.hpp"
#include "mesh/spacing_field.hpp"
#include "mesh/winding_number.hpp"
#include "model/graded_hash.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using testing::HasSubstr;

/// No grading but what regions ask for.
Grading plain(double ratio) {
  Grading grading;
  grading.ratio = ratio;
  grading.per_radius = grading.across = 0;
  return grading;
}
Grading ratio_of(double ratio) {
  Grading grading;
  grading.ratio = ratio;
  return grading;
}

SpaceRegion ball(Vec3d centre, double radius) {
  SpaceRegion region;
  region.is_ball = true;
  region.centre = centre;
  region.radius = radius;
  return region;
}

Grading finer_in(const SpaceRegion& region, double ratio) {
  Grading grading = plain(ratio);
  grading.finer.push_back({region, ratio});
  return grading;
}

Cloud sampled(const Surface& surface, Index phyxels, const Grading& grading) {
  return sample_surface(surface, {.phyxels = phyxels, .grading = grading});
}

/// A closed cylinder along z with flat sides, each of two triangles.
Surface cylinder(double radius, Index sides, double length) {
  Surface s;
  for (Index k = 0; k < sides; ++k) {
    const double angle = 2 * std::numbers::pi * k / sides;
    for (const double z : {0.0, length}) {
      s.position.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  }
  const Index bottom = 2 * sides, top = bottom + 1;
  s.position.push_back({0, 0, 0});
  s.position.push_back({0, 0, length});
  for (Index k = 0; k < sides; ++k) {
    const Index a = 2 * k, b = 2 * ((k + 1) % sides);
    s.triangle.insert(s.triangle.end(),
                      {{a, b, b + 1}, {a, b + 1, a + 1}, {bottom, b, a}, {top, a + 1, b + 1}});
  }
  test::add_normals(s);
  return s;
}

/// The middle of values.
double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

/// The distance from each phyxel to the nearest other one [m].
std::vector<double> gaps(const Cloud& cloud) {
  const GradedHash hash(cloud.position, cloud.spacing);
  std::vector<double> gap(cloud.position.size());
  for (std::size_t i = 0; i < gap.size(); ++i) {
    const auto self = static_cast<Index>(i);
    gap[i] = std::sqrt(hash.nearest(cloud.position[i], HUGE_VAL, self).distance2);
  }
  return gap;
}

double of_all(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

/// The phyxels for which choose(position) is true have this median distance to the nearest other.
template <class Choose>
double median_gap(const Cloud& cloud, Choose&& choose) {
  const std::vector<double> gap = gaps(cloud);
  std::vector<double> chosen;
  for (std::size_t i = 0; i < gap.size(); ++i) {
    if (choose(cloud.position[i])) chosen.push_back(gap[i]);
  }
  return median(chosen);
}

TEST(SpacingCone, IsTheSmallestOfAllSources) {
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<double> along(0, 1);
  std::vector<SpacingSource> sources;
  for (int k = 0; k < 500; ++k) {
    const double x = along(engine), y = along(engine), z = along(engine);
    sources.push_back({{x, y, 0.1 * z}, 0.01 + 0.2 * along(engine)});
  }
  const double growth = 0.3, most = 0.15;
  const Box box{{-1, -1, -1}, {2, 2, 2}};
  const SpacingCone cone(sources, growth, 0.01, most, box);
  for (int trial = 0; trial < 2000; ++trial) {
    const double x = along(engine), y = along(engine), z = along(engine);
    const Vec3d p = 2.0 * Vec3d{x - 0.3, y - 0.3, z - 0.3};
    double smallest = most;
    for (const SpacingSource& s : sources) {
      smallest = std::min(smallest, s.spacing + growth * norm(p - s.place));
    }
    EXPECT_DOUBLE_EQ(cone.at(p), smallest);
  }
  EXPECT_EQ(cone.at({50, 0, 0}), most);
  EXPECT_EQ(SpacingCone({}, growth, 0.01, most, box).at({0, 0, 0}), most);
}

/// A source that wants more than another one does at its place wants the smallest spacing nowhere.
TEST(SourceTree, LeavesOutSourcesThatWantTheSmallestSpacingNowhere) {
  const double growth = 0.25;
  std::vector<SpacingSource> sources{{{0, 0, 0}, 0.1}, {{1, 0, 0}, 0.3}, {{1, 1, 0}, 0.5}};
  // The first one wants 0.35 at (1, 0, 0), where the second one wants less, and the second one
  // wants 0.55 at (1, 1, 0); but 0.1 + 0.25 * sqrt(2) < 0.5.
  const std::vector<SpacingSource> kept = SourceTree(sources, growth).that_matter();
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_EQ(std::max(kept[0].spacing, kept[1].spacing), 0.3);
  sources[2].spacing = 0.45;
  EXPECT_EQ(SourceTree(sources, growth).that_matter().size(), 3u);
}

/// Threads that make the cubes of the octree at the same time find the same spacings as one thread.
TEST(SpacingCone, IsTheSameOnManyThreads) {
  std::mt19937_64 engine(4);
  std::uniform_real_distribution<double> along(0, 1);
  std::vector<SpacingSource> sources;
  for (int k = 0; k < 3000; ++k) {
    sources.push_back({{along(engine), along(engine), along(engine)}, 0.01 + 0.02 * along(engine)});
  }
  std::vector<Vec3d> place;
  for (int k = 0; k < 20000; ++k) place.push_back({along(engine), along(engine), along(engine)});
  const Box box{{0, 0, 0}, {1, 1, 1}};
  const SpacingCone one(sources, 0.3, 0.01, 1, box), many(sources, 0.3, 0.01, 1, box);
  std::vector<double> spacing(place.size());
  constexpr std::size_t threads = 8;
  std::vector<std::thread> running;
  for (std::size_t t = 0; t < threads; ++t) {
    running.emplace_back([&, t] {
      for (std::size_t k = t; k < place.size(); k += threads) spacing[k] = many.at(place[k]);
    });
  }
  for (std::thread& thread : running) thread.join();
  for (std::size_t k = 0; k < place.size(); ++k) EXPECT_EQ(spacing[k], one.at(place[k]));
}

/// Between two fine regions the distance grows from either, and nowhere faster than asked.
TEST(SpacingField, GrowsNoFasterThanAsked) {
  std::vector<FinerRegion> regions{{ball({0, 0, 0}, 0.1), 8}, {ball({1, 0, 0}, 0.2), 4}};
  const SpacingField field(nullptr, regions, 0.2, 8, 0.08);
  EXPECT_DOUBLE_EQ(field.at({0, 0.05, 0}), 0.01);
  EXPECT_DOUBLE_EQ(field.at({1.1, 0, 0}), 0.02);
  EXPECT_DOUBLE_EQ(field.at({0.2, 0, 0}), 0.03);
  EXPECT_DOUBLE_EQ(field.at({-3, 0, 0}), 0.08);
  for (double x = -1; x < 2; x += 0.01) {
    const double change = field.at({x + 0.01, 0, 0}) - field.at({x, 0, 0});
    EXPECT_LE(std::abs(change), 0.2 * 0.01 * (1 + 1e-12));
  }
}

/// Points at the wanted distances stay where they are: planes of points, as dense as asked, move by
/// less than a two-hundredth of a spacing. If forces had one energy for all, they would move by
/// 0.044 of it, to where points are farther apart.
TEST(GradedRepulsion, DoesNotPushFinePointsAmongCoarseOnes) {
  const SpacingField field(nullptr, {{ball({0, 0, 0}, 1e-9), 8}}, 0.1, 8, 0.4);
  std::vector<Vec3d> point;
  std::vector<double> planes;  // at distances as asked, perpendicular to x
  for (double x = 0.5; x < 3; x += field.at({x, 0, 0})) planes.push_back(x);
  for (const double x : planes) {
    const double s = field.at({x, 0, 0});
    for (int y = -5; y <= 5; ++y) {
      for (int z = -5; z <= 5; ++z) point.push_back({x, y * s, z * s});
    }
  }
  const GradedRepulsion repulsion(point, 0, field);
  std::vector<Vec3d> step(point.size());
  repulsion.for_each(
      [&](std::size_t i, auto&& step_of) { step[i] = step_of([](Index) { return 1.0; }); });
  for (std::size_t k = 6; k + 6 < planes.size(); ++k) {
    const std::size_t middle = 121 * k + 60;
    EXPECT_LT(norm(step[middle]), 0.005 * field.at(point[middle]));
  }
}

TEST(Grading, HasExactlyAsManyPhyxelsAtTheWantedDistances) {
  const Cloud cloud = sampled(test::unit_cube(), 6000, finer_in(ball({0.5, 0.5, 0.5}, 0.15), 5));
  EXPECT_EQ(cloud.position.size(), 6000u);
  ASSERT_EQ(cloud.spacing.size(), 6000u);
  const auto [finest, coarsest] = std::ranges::minmax(cloud.spacing);
  EXPECT_NEAR(coarsest / finest, 5, 1e-6);
  const std::vector<double> gap = gaps(cloud);
  std::vector<double> relative(gap.size());
  for (std::size_t i = 0; i < gap.size(); ++i) relative[i] = gap[i] / cloud.spacing[i];
  // As those of clouds with one distance: 0.92 in the middle, none below a half (0.6 here).
  EXPECT_NEAR(median(relative), 0.92, 0.04);
  EXPECT_GT(*std::ranges::min_element(relative), 0.5);
  EXPECT_LT(*std::ranges::max_element(relative), 1.3);
  // Measured, and not only wanted: five times nearer in the ball than in the corners.
  const auto from_middle = [](Vec3d p) { return norm(p - Vec3d{0.5, 0.5, 0.5}); };
  const double fine = median_gap(cloud, [&](Vec3d p) { return from_middle(p) < 0.12; }),
               coarse = median_gap(cloud, [&](Vec3d p) { return from_middle(p) > 0.7; });
  EXPECT_NEAR(coarse / fine, 5, 0.6);
}

TEST(Grading, VolumesAddUpAndFollowTheDistances) {
  const Surface body = test::sphere({0, 0, 0}, 1, 4);
  const Cloud cloud = sampled(body, 5000, finer_in(ball({0.9, 0, 0}, 0.2), 6));
  EXPECT_NEAR(of_all(cloud.volume), enclosed_volume(body), 1e-12);
  const WindingNumber winding(body);
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    const double cube = std::pow(cloud.spacing[i], 3);
    if (norm(cloud.position[i]) > 1 - 1.5 * cloud.spacing[i]) continue;
    EXPECT_GT(winding(cloud.position[i]), 0.5);
    // Inside: the cells of relaxed points differ by a third at most.
    EXPECT_NEAR(cloud.volume[i] / cube, 1.05, 0.45) << norm(cloud.position[i]);
  }
  // The first moments of a ball are zero; of coarse phyxels alone they would be off by percents.
  Vec3d moment;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    moment += cloud.volume[i] * cloud.position[i];
  }
  EXPECT_LT(norm(moment), 2e-3 * enclosed_volume(body));
}

/// A block with a fin of a tenth of its thickness: five phyxels through the fin.
TEST(Grading, ThinPartsHavePhyxelsAcross) {
  const Surface both = test::together(test::unit_cube(), test::box({1.5, 0, 0}, {2.5, 1, 0.1}));
  Grading grading = plain(8);
  grading.across = 5;
  const Cloud cloud = sampled(both, 9000, grading);
  const double in_fin = median_gap(cloud, [](Vec3d p) { return p.x > 1.7 && p.x < 2.3; }),
               in_cube = median_gap(cloud, [](Vec3d p) {
                 return p.x < 0.8 && norm(p - Vec3d{0.5, 0.5, 0.5}) < 0.3;
               });
  // The distance of relaxed points from the nearest is 0.92 to 0.98 of the one they stand for, and
  // beyond the fin's edges it grows.
  EXPECT_NEAR(in_fin, 0.1 / 5, 0.003);
  EXPECT_GT(in_cube, 2 * in_fin);
}

/// Two balls, one a quarter as large: phyxels are as near to each other as either radius asks for.
TEST(Grading, CurvedSurfacesHavePhyxelsOverTheirRadius) {
  const Surface both =
      test::together(test::sphere({0, 0, 0}, 1, 4), test::sphere({2.5, 0, 0}, 0.25, 4));
  Grading grading = plain(8);
  grading.per_radius = 5;
  const Cloud cloud = sampled(both, 8000, grading);
  const double on_small = median_gap(cloud, [](Vec3d p) { return p.x > 1.5; }),
               in_large = median_gap(cloud, [](Vec3d p) { return norm(p) < 0.5; });
  EXPECT_NEAR(on_small, 0.25 / 5, 0.006);
  EXPECT_GT(in_large, 1.3 * on_small);
  // A cylinder is curved in one direction alone, and each of its sides is one long strip.
  grading.per_radius = 8;
  const Cloud bar = sampled(cylinder(0.5, 24, 6), 12000, grading);
  EXPECT_NEAR(median_gap(bar, [](Vec3d p) { return std::hypot(p.x, p.y) > 0.45; }), 0.5 / 8, 0.007);
}

TEST(Grading, IsTheSameOnAnyNumberOfThreads) {
  const Grading grading = finer_in(ball({1, 1, 1}, 0.3), 4);
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const Cloud one = sampled(test::unit_cube(), 3000, grading);
  omp_set_num_threads(3);
  const Cloud three = sampled(test::unit_cube(), 3000, grading);
  omp_set_num_threads(threads);
  EXPECT_EQ(one.position, three.position);
  EXPECT_EQ(one.volume, three.volume);
  EXPECT_EQ(one.spacing, three.spacing);
}

/// A region that cuts a graded body has phyxels on its boundary, at the distances there.
TEST(Grading, SupportsCutGradedBodies) {
  SpaceRegion clamp;
  clamp.low = {-1, -1, -1};
  clamp.high = {2, 2, 0.3};
  const Cloud cloud = sample_surface(
      test::unit_cube(),
      {.phyxels = 6000, .cuts = {clamp}, .grading = finer_in(ball({0.5, 0.5, 0.3}, 0.1), 4)});
  EXPECT_EQ(cloud.position.size(), 6000u);
  ASSERT_EQ(cloud.cuts.list.size(), 1u);
  std::size_t on_cut = 0, fine = 0;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (std::abs(cloud.position[i].z - 0.3) > 1e-5) continue;
    ++on_cut;
    fine += norm(cloud.position[i] - Vec3d{0.5, 0.5, 0.3}) < 0.1;
  }
  // A phyxel on each square of the spacing: a fifth of them in the ball's 3% of the area.
  EXPECT_GT(on_cut, 200u);
  EXPECT_GT(fine, on_cut / 8);
}

TEST(Grading, WithoutWishesIsOneDistance) {
  const Cloud cloud = sampled(test::unit_cube(), 2000, plain(4));
  const auto [finest, coarsest] = std::ranges::minmax(cloud.spacing);
  EXPECT_DOUBLE_EQ(finest, coarsest);
  SampleReport report;
  sample_surface(test::unit_cube(), {.phyxels = 1000, .grading = finer_in(ball({9, 9, 9}, 1), 4)},
                 &report);
  EXPECT_THAT(report.warnings,
              testing::ElementsAre(HasSubstr("the grading has no effect"),
                                   HasSubstr("finer region 1 of the grading holds no phyxel")));
}

/// However much a scene grades, at least two phyxels are through the thickness of a bar far from
/// the finer region.
TEST(Grading, LeavesPhyxelsThroughTheThickness) {
  Grading grading = finer_in(ball({4, 0.1, 0.1}, 0.2), 10);
  grading.growth = 0.5;
  const Cloud cloud = sampled(test::box({0, 0, 0}, {4, 0.4, 0.4}), 3000, grading);
  EXPECT_LT(*std::ranges::max_element(cloud.spacing), 0.4 / 2 * 1.05);
  // Half of the volume is not on the faces of a bar: a single layer has all of it there.
  double second = 0;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (cloud.position[i].x > 2) continue;
    const double z = cloud.position[i].z - 0.2;
    second += cloud.volume[i] * z * z;
  }
  const double exact = 2 * std::pow(0.4, 4) / 12;
  EXPECT_LT(second / exact, 1.6);  // 1 + 2 (s/H)² with two layers; 3 with one
}

void expect_refusal(const Surface& surface, const SampleRequest& request, const char* words) {
  try {
    sample_surface(surface, request);
    ADD_FAILURE() << "not refused: " << words;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(words));
  }
}

TEST(Grading, RefusesWhatCannotBe) {
  const Surface cube = test::unit_cube();
  expect_refusal(cube, {.phyxels = 100, .grading = ratio_of(11)},
                 "grading: ratio is 11; allowed: 1 to 10");
  expect_refusal(cube, {.phyxels = 100, .grading = ratio_of(std::nan(""))},
                 "grading: ratio is nan; allowed: 1 to 10");
  Grading slow;
  slow.growth = 0;
  expect_refusal(cube, {.phyxels = 100, .grading = slow},
                 "grading: growth is 0; allowed: 0.05 to 0.5");
  Grading finer = finer_in(ball({0, 0, 0}, 1), 4);
  finer.finer[0].by = 5;
  expect_refusal(cube, {.phyxels = 100, .grading = finer}, "grading: by is 5; allowed: 1 to 4");
  expect_refusal(cube, {.phyxels = 100, .on_surface = false, .grading = Grading{}},
                 "a graded body has phyxels on its surface; allowed: on_surface = true");
  expect_refusal(test::without(cube, 0), {.phyxels = 1000, .grading = Grading{}},
                 "a graded body has phyxels on its surface: the surface is not closed");
  expect_refusal(cube, {.phyxels = 2'000'000'000, .grading = Grading{}}, "of memory to sample");
}

}  // namespace
}  // namespace phyxel
