/// Winding numbers and defects of surfaces.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "mesh/inside_samples.hpp"
#include "mesh/triangle.hpp"
#include "mesh/winding_number.hpp"
#include "phyxel/mesh.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

Vec3d random_point(std::mt19937_64& engine, double low, double high) {
  std::uniform_real_distribution<double> along(low, high);
  const double x = along(engine), y = along(engine), z = along(engine);
  return {x, y, z};
}

// --- winding number -----------------------------------------------------------------------------

double direct(const Surface& s, Vec3d p) {
  return direct_winding_number(s.position, s.triangle, p);
}

/// The distance of a point from the surface of the unit cube [m].
double distance_from_cube(Vec3d p) {
  const double inside = std::min({p.x, 1 - p.x, p.y, 1 - p.y, p.z, 1 - p.z});
  if (inside >= 0) return inside;
  const auto beyond = [](double x) { return std::max({0.0, -x, x - 1}); };
  return norm(Vec3d{beyond(p.x), beyond(p.y), beyond(p.z)});
}

TEST(WindingNumber, KnowsTheDistanceToTheNearestTriangle) {
  const Surface cube = test::unit_cube(), ball = test::sphere({0.5, 0.5, 0.5}, 0.4, 3);
  const WindingNumber of_cube(cube), of_ball(ball);
  std::mt19937_64 engine(4);
  for (int k = 0; k < 1000; ++k) {
    const Vec3d p = random_point(engine, -0.5, 1.5);
    EXPECT_NEAR(of_cube.distance(p, 10), distance_from_cube(p), 1e-12);
    EXPECT_NEAR(of_cube.distance(p, 0.1), std::min(0.1, distance_from_cube(p)), 1e-12);
    double nearest = 10;
    for (const auto [a, b, c] : ball.triangle) {
      const Vec3d at = nearest_on_triangle(p, ball.position[a], ball.position[b], ball.position[c]);
      nearest = std::min(nearest, norm(at - p));
    }
    EXPECT_EQ(of_ball.distance(p, 10), nearest);
  }
}

/// Points that wander, and stay where a step would lead out, are inside whatever ball they have.
TEST(InsideSampler, TellsWhichStepsStayInside) {
  const Surface cube = test::unit_cube();
  const InsideSampler sampler(cube, true);
  std::mt19937_64 engine(5);
  int stayed = 0, left = 0;
  for (int point = 0; point < 20; ++point) {
    Vec3d at = random_point(engine, 0.05, 0.95);
    ClearBall ball;
    for (int step = 0; step < 200; ++step) {
      const Vec3d after = at + random_point(engine, -0.1, 0.1);
      const double low = std::min({after.x, after.y, after.z}),
                   high = std::max({after.x, after.y, after.z});
      const bool is_inside = low > 0 && high < 1;
      ASSERT_EQ(sampler.stays_inside(at, after, 0.3, ball), is_inside);
      ++(is_inside ? stayed : left);
      if (is_inside) at = after;
    }
  }
  EXPECT_GT(stayed, 1000);
  EXPECT_GT(left, 100);
}

TEST(WindingNumber, IsOneInsideAndZeroOutside) {
  const Surface cube = test::unit_cube();
  EXPECT_NEAR(direct(cube, {0.5, 0.5, 0.5}), 1, 1e-14);  // rounding of twelve arctangents
  EXPECT_NEAR(direct(cube, {0.01, 0.99, 0.3}), 1, 1e-14);
  EXPECT_NEAR(direct(cube, {1.01, 0.5, 0.5}), 0, 1e-14);
  EXPECT_NEAR(direct(cube, {-40, 7, 3}), 0, 1e-14);
  EXPECT_NEAR(direct(test::turned(cube), {0.5, 0.5, 0.5}), -1, 1e-14);
}

TEST(WindingNumber, MissingFaceTakesItsSolidAngle) {
  // Seen from the middle each face fills a sixth of the sky, from the middle of the open face none.
  const Surface open = test::without(test::without(test::unit_cube(), 3), 2);
  EXPECT_NEAR(direct(open, {0.5, 0.5, 0.5}), 5.0 / 6, 1e-14);
  EXPECT_NEAR(direct(open, {0.5, 0.5, 1}), 0.5, 1e-14);
  // A square of half side 1/2 at distance h fills 4 asin(a^2 / (a^2 + h^2)) of 4 pi.
  const double h = 2, angle = 4 * std::asin(0.25 / (0.25 + h * h));
  EXPECT_NEAR(direct(open, {0.5, 0.5, 1 + h}), angle / (4 * std::numbers::pi), 1e-14);
}

TEST(WindingNumber, CountsNestedAndOverlappingParts) {
  const Surface outer = test::sphere({0, 0, 0}, 1, 3), inner = test::sphere({0.2, 0, 0}, 0.5, 3);
  const Surface hollow = test::together(outer, test::turned(inner));
  EXPECT_NEAR(direct(hollow, {0.2, 0, 0}), 0, 1e-12);  // rounding of 1024 arctangents
  EXPECT_NEAR(direct(hollow, {-0.6, 0, 0}), 1, 1e-12);
  EXPECT_NEAR(direct(hollow, {0, 1.2, 0}), 0, 1e-12);
  EXPECT_NEAR(direct(test::together(outer, inner), {0.2, 0, 0}), 2, 1e-12);
}

TEST(WindingNumber, FastSummationAgreesWithTheDirectSum) {
  const Surface ball = test::sphere({0, 0, 0}, 1, 5);  // 8192 triangles
  Surface open = ball;
  open.triangle.resize(open.triangle.size() / 2);
  std::mt19937_64 engine(7);
  for (const Surface& s : {ball, open}) {
    const WindingNumber fast(s);
    const WindingNumber slower(s, 10);
    double worst = 0, worst_slower = 0;
    for (int k = 0; k < 300; ++k) {
      const Vec3d p = random_point(engine, -1.5, 1.5);
      const double exact = direct(s, p);
      worst = std::max(worst, std::abs(fast(p) - exact));
      worst_slower = std::max(worst_slower, std::abs(slower(p) - exact));
    }
    // What the expansion leaves out at 2.5 radii; the header promises 0.05, inside needs 0.5. At
    // four times the distance a sixteenth of it.
    EXPECT_LT(worst, 0.05);
    EXPECT_LT(worst_slower, worst / 8);
    EXPECT_GT(worst_slower, 0.0);  // far groups are expanded
  }
}

/// The expansion of a distant group has its area, a term of 1/r^2, and its moment, of 1/r^3. The
/// error is of 1/r^4: at twice the distance it is a sixteenth; without the moment it would be an
/// eighth.
TEST(WindingNumber, FarGroupsKeepTheirSecondOrder) {
  // An open half of a ball, which has a moment about its centre; all of it is one far group.
  Surface bowl = test::sphere({0, 0, 0}, 1, 3);
  std::erase_if(bowl.triangle, [&](const Triangle& t) {
    return bowl.position[t[0]].z + bowl.position[t[1]].z + bowl.position[t[2]].z > 0;
  });
  const WindingNumber fast(bowl);
  const auto error_at = [&](double distance) {
    double worst = 0;
    for (const Vec3d way : {Vec3d{1, 0, 0}, {0, 1, 1}, {0, 0, 1}, {-1, 2, -3}}) {
      const Vec3d p = distance * normalised(way);
      worst = std::max(worst, std::abs(fast(p) - direct(bowl, p)));
    }
    return worst;
  };
  const double near = error_at(8), far = error_at(16);
  EXPECT_GT(near, 0);
  EXPECT_LT(far, near / 12);  // between 8 and 16
}

// --- defects ------------------------------------------------------------------------------------

TEST(SurfaceDefects, HolesAreCountedAndPlaced) {
  const SurfaceDefects defects = inspect_surface(test::without(test::unit_cube(), 11));
  EXPECT_EQ(defects.open_edges, 3);
  EXPECT_EQ(defects.crowded_edges + defects.flipped_edges + defects.degenerate_triangles, 0);
  EXPECT_FALSE(defects.clean());
  EXPECT_EQ(defects.example.x, 1.0);  // triangle 11 lies in x = 1
  EXPECT_THAT(defects.describe(), HasSubstr("3 open edges (holes); one is near (1, "));
}

TEST(SurfaceDefects, FlippedCrowdedFlatAndUnusedAreCounted) {
  Surface s = test::unit_cube();
  std::swap(s.triangle[4][1], s.triangle[4][2]);
  EXPECT_EQ(inspect_surface(s).flipped_edges, 3);

  s = test::unit_cube();
  s.position.push_back({0.5, 0.5, 3});
  EXPECT_EQ(inspect_surface(s).unused_vertices, 1);
  s.triangle.push_back({0, 1, 8});
  SurfaceDefects defects = inspect_surface(s);
  EXPECT_EQ(defects.crowded_edges, 1);
  EXPECT_EQ(defects.open_edges, 2);
  EXPECT_EQ(defects.unused_vertices, 0);

  s.triangle.back() = {0, 1, 1};
  EXPECT_EQ(inspect_surface(s).degenerate_triangles, 1);
  s.position[8] = {0.25, 0, 0};
  s.triangle.back() = {0, 8, 1};
  EXPECT_EQ(inspect_surface(s).degenerate_triangles, 1);
}

TEST(SurfaceDefects, PartsAndTheirSideAreSeen) {
  const Surface two = test::together(test::unit_cube(), test::box({3, 0, 0}, {4, 1, 1}));
  EXPECT_EQ(inspect_surface(two).parts, 2);
  EXPECT_TRUE(inspect_surface(two).clean());
  EXPECT_TRUE(inspect_surface(test::turned(two)).inside_out);
  EXPECT_THAT(inspect_surface(test::turned(two)).describe(), HasSubstr("2 parts, inside out"));
}

}  // namespace
}  // namespace phyxel
