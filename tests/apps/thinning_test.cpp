/// Surfaces of pages that have fewer surfels than the frames.
#include "report/thinning.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "ball.hpp"
#include "report/report.hpp"
#include "support/page.hpp"

namespace phyxel::app {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

double area_of(const std::vector<Vec3d>& point, const std::vector<Triangle>& triangle) {
  double sum = 0;
  for (const Triangle& t : triangle) {
    const auto at = [&](std::size_t c) { return point[static_cast<std::size_t>(t[c])]; };
    sum += norm(cross(at(1) - at(0), at(2) - at(0))) / 2;
  }
  return sum;
}

std::vector<Vec3d> points_of(const FrameData& surface, const ThinnedSurface& thin) {
  std::vector<Vec3d> points;
  for (const std::size_t s : thin.surfel) points.push_back(surface.point[s]);
  return points;
}

TEST(Thinning, KeepsTheShapeWithAsManySurfelsAsAsked) {
  const FrameData ball = sphere({5, -3, 2}, 2, 100);
  const double area = 4 * std::numbers::pi * 4;
  for (const std::size_t most : {8000u, 2000u, 500u}) {
    const ThinnedSurface thin = thinned(ball, most);
    EXPECT_LE(thin.surfel.size(), most);
    EXPECT_GE(thin.surfel.size(), most / 2);
    EXPECT_TRUE(std::is_sorted(thin.surfel.begin(), thin.surfel.end()));
    // Cells of 500 surfels are 0.4 wide; a polyhedron with such edges has 1% less area.
    EXPECT_NEAR(area_of(points_of(ball, thin), thin.triangle), area, 0.03 * area);
    // Triangles face outwards, but for slivers that the grid folds, and are there once.
    const auto point = points_of(ball, thin);
    std::vector<Triangle> folded;
    for (const Triangle& t : thin.triangle) {
      const auto at = [&](std::size_t c) { return point[static_cast<std::size_t>(t[c])]; };
      if (dot(cross(at(1) - at(0), at(2) - at(0)), at(0) - Vec3d{5, -3, 2}) < 0) {
        folded.push_back(t);
      }
    }
    EXPECT_LT(area_of(point, folded), 0.005 * area);
    EXPECT_EQ(std::set(thin.triangle.begin(), thin.triangle.end()).size(), thin.triangle.size());
  }
}

TEST(Thinning, LeavesSmallSurfacesAsTheyAre) {
  const FrameData ball = sphere({0, 0, 0}, 1, 10);
  const ThinnedSurface all = thinned(ball, ball.point.size());
  EXPECT_EQ(all.triangle, ball.triangle);
  EXPECT_EQ(all.surfel.size(), ball.point.size());
}

/// Bodies that lie in one another stay apart.
TEST(Thinning, JoinsNoTwoBodies) {
  FrameData both = sphere({0, 0, 0}, 1, 40);
  const auto n = static_cast<Index>(both.point.size());
  both.body.assign(both.point.size(), 0);
  const FrameData other = sphere({0.01, 0, 0}, 1, 40);
  both.point.insert(both.point.end(), other.point.begin(), other.point.end());
  both.body.insert(both.body.end(), other.point.size(), 1);
  for (const auto& [a, b, c] : other.triangle) both.triangle.push_back({a + n, b + n, c + n});
  const ThinnedSurface thin = thinned(both, 400);
  EXPECT_LE(thin.surfel.size(), 400u);
  std::set<Index> seen;
  for (const Triangle& t : thin.triangle) {
    const auto body = [&](std::size_t c) {
      return both.body[thin.surfel[static_cast<std::size_t>(t[c])]];
    };
    EXPECT_TRUE(body(0) == body(1) && body(1) == body(2));
    seen.insert(body(0));
  }
  EXPECT_EQ(seen.size(), 2u);
}

/// Frames of a surface that cracks open have the first of its triangles, fewer and fewer, in the
/// whole surface and in a thinned one.
TEST(Thinning, OrdersTrianglesByWhenTheyAreGone) {
  const FrameData ball = sphere({0, 0, 0}, 1, 30);
  for (const std::size_t most : {ball.point.size(), std::size_t{300}}) {
    const ThinnedSurface thin = thinned(ball, most);
    std::vector<std::vector<Triangle>> of_frames;
    for (const double height : {2.0, 0.5, 0.5, -0.2, -2.0}) {
      std::vector<Triangle> below;
      for (const Triangle& t : ball.triangle) {
        if (ball.point[static_cast<std::size_t>(t[0])].z < height) below.push_back(t);
      }
      of_frames.push_back(thin.shown(below));
    }
    std::vector<Triangle> ordered = thin.triangle;
    const std::vector<std::size_t> counts = sort_by_last_frame(ordered, of_frames);
    ASSERT_EQ(counts.size(), of_frames.size());
    EXPECT_EQ(counts.front(), thin.triangle.size());
    EXPECT_GT(counts[1], counts[3]);
    EXPECT_GT(counts[3], 0u);
    EXPECT_EQ(counts.back(), 0u);
    for (std::size_t k = 0; k < counts.size(); ++k) {
      const auto end = ordered.begin() + static_cast<std::ptrdiff_t>(counts[k]);
      EXPECT_EQ(std::set(ordered.begin(), end), std::set(of_frames[k].begin(), of_frames[k].end()));
    }
  }
}

TEST(Thinning, BearsPointsThatAreNotFinite) {
  FrameData ball = sphere({0, 0, 0}, 1, 20);
  for (std::size_t s = 0; s < ball.point.size(); s += 7) ball.point[s].y = std::nan("");
  ball.point[1] = {HUGE_VAL, 1e300, -1e300};
  EXPECT_LE(thinned(ball, 200).surfel.size(), 200u);
  for (Vec3d& p : ball.point) p = {std::nan(""), 0, 0};
  EXPECT_EQ(thinned(ball, 200).surfel.size(), 1u);
}

class ThinnedPages : public test::Folder {
 protected:
  /// Writes frames of a ball that grows, with a phyxel at its middle.
  void record(int quads, int frames) {
    const FrameData ball = sphere({0, 0, 0}, 1, quads);
    Model model;
    model.position = {{0, 0, 0}};
    model.mass = model.volume = {1};
    model.surfels.position = ball.point;
    model.surfels.normal = ball.normal;
    model.surfels.triangle = ball.triangle;
    Part part;
    part.end = 1;
    part.surfel_end = static_cast<Index>(ball.point.size());
    model.parts = {part};
    Scene scene;
    scene.output.directory = folder_ / "run";
    scene.time.end = 1;
    Recorder recorder(model, scene, false);
    for (int k = 0; k < frames; ++k) {
      State state;
      state.displacement = state.velocity = {Vec3d{}};
      state.time = 0.01 * k;
      state.step = k;
      SurfelState surfels{ball.point, ball.normal};
      for (Vec3d& p : surfels.position) p = (1 + 0.01 * k) * p;
      Frame frame;
      frame.state = &state;
      frame.surfels = &surfels;
      frame.diagnostics.time = state.time;
      frame.diagnostics.step = k;
      recorder.write(frame);
    }
  }
};

TEST_F(ThinnedPages, StayBelowTheirSizeWithAllFrames) {
  record(170, 60);  // 58,140 surfels: 60 frames of all take 28 MB as text
  const Report report = replay_page({.input = folder_ / "run"});
  EXPECT_LT(report.html.size(), 16'000'000u);
  EXPECT_GT(report.html.size(), 12'000'000u);  // no more is lost than must be
  EXPECT_EQ(report.frames, 60u);
  EXPECT_GE(report.surfels, 20'000u);
  EXPECT_THAT(report.notes, Contains(HasSubstr("of its 58,140 surfels, for a page below 16 MB")));
  EXPECT_THAT(report.html, HasSubstr(" drawn), 60 frames"));
  // Frames, triangles and carriers are of the same surfels, in each frame where the ball is.
  const auto data = test::data_of(report.html);
  const auto surfels = data["surfels"].get<std::size_t>();
  EXPECT_EQ(surfels, report.surfels);
  for (const Triangle& t : test::embedded<Triangle>(report.html, "triangles")) {
    EXPECT_LT(static_cast<std::size_t>(*std::max_element(t.begin(), t.end())), surfels);
  }
  EXPECT_EQ(test::embedded<std::uint8_t>(report.html, "weights").size(), 4 * surfels);
  const auto radius = [&](const char* frame) {
    const auto numbers = test::embedded<std::uint16_t>(report.html, frame);
    double sum = 0;
    for (std::size_t s = 0; s < surfels; ++s) {
      double square = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const double x =
            numbers[3 * s + c] * data["scale"][c].get<double>() + data["low"][c].get<double>();
        square += x * x;
      }
      sum += std::sqrt(square);
    }
    return sum / static_cast<double>(surfels);
  };
  EXPECT_NEAR(radius("frame59") / radius("frame0"), 1.59, 1e-3);
}

TEST_F(ThinnedPages, AreWholeWhereAllFits) {
  record(40, 10);
  const Report report = replay_page({.input = folder_ / "run"});
  EXPECT_EQ(report.surfels, 3280u);
  EXPECT_THAT(report.notes, ::testing::Not(Contains(HasSubstr("surfels"))));
  const Report small = replay_page({.input = folder_ / "run", .megabytes = 1});
  EXPECT_LT(small.html.size(), 1'000'000u);
  EXPECT_EQ(small.frames, 10u);
  EXPECT_EQ(small.surfels, 3280u);
}

}  // namespace
}  // namespace phyxel::app
