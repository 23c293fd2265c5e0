/// Cuts through bodies: planes, what they leave of a surface, and the faces that they show.
#include "cut.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ball.hpp"
#include "compose.hpp"

namespace phyxel::app {
namespace {

using ::testing::HasSubstr;

constexpr Colour black{0, 0, 0}, grey{0.5f, 0.5f, 0.5f};
constexpr double pi = std::numbers::pi;

/// A camera at a height above the origin that looks down, with y up on the picture.
Camera looking_down(double height, double focal = 400) {
  return {200, 160, {0, 0, height}, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}, focal};
}

DrawnSurface drawn(const FrameData& frame, Index body = 0) {
  return {frame.point, frame.normal, std::vector(frame.point.size(), grey),
          std::vector(frame.point.size(), body), frame.triangle};
}

/// Adds a surface, inside out or not, of another body.
void append(DrawnSurface& to, const DrawnSurface& more, bool inside_out = false) {
  const auto first = static_cast<Index>(to.point.size());
  to.point.insert(to.point.end(), more.point.begin(), more.point.end());
  to.normal.insert(to.normal.end(), more.normal.begin(), more.normal.end());
  to.colour.insert(to.colour.end(), more.colour.begin(), more.colour.end());
  to.body.insert(to.body.end(), more.body.begin(), more.body.end());
  for (const auto& [a, b, c] : more.triangle) {
    to.triangle.push_back({a + first, (inside_out ? c : b) + first, (inside_out ? b : c) + first});
  }
}

/// The area that an outline in a plane across z goes around, by its edges.
double area_of(const CutOutline& outline) {
  double twice = 0;
  for (const auto& [a, b] : outline.edges) twice += a.x * b.y - a.y * b.x;
  return std::abs(0.5 * twice);
}

/// Number of samples that the faces of a cut take, per pixel, and the picture.
double face_pixels(const std::vector<CutOutline>& outlines, const CutPlane& plane,
                   const Camera& camera) {
  Rasteriser rasteriser(camera, {0, 0, 1}, black, black);
  for (const CutOutline& outline : outlines) {
    draw_face(rasteriser, outline, plane, [](const std::vector<Vec3d>& places) {
      return std::vector<Colour>(places.size(), grey);
    });
  }
  const int samples = rasteriser.samples();
  double count = 0;
  for (int y = 0; y < samples * camera.height; ++y) {
    for (int x = 0; x < samples * camera.width; ++x) count += rasteriser.body(x, y) >= 0;
  }
  return count / (samples * samples);
}

TEST(CutPlanes, AreReadWithTheSideThatIsCutAway) {
  const CutPlane near = cut_plane("y=0.25", {5, -3, 2});
  EXPECT_EQ(norm(near.point - Vec3d{0, 0.25, 0}), 0);
  EXPECT_LT(near.height({0, 1, 0}), 0);  // beyond the plane as the camera sees it
  EXPECT_GT(cut_plane("y=0.25", {5, 3, 2}).height({0, 1, 0}), 0);
  const CutPlane slanted = cut_plane("1,0,0,0,3,4", {9, 9, 9});
  EXPECT_NEAR(slanted.height({1, 3, 4}), 5, 1e-15);
  EXPECT_NEAR(slanted.height({7, -3, -4}), -5, 1e-15);
  for (const char* wrong : {"", "w=1", "x=", "x=1,2", "x=nan", "y=1m", "1,2,3", "1,2,3,0,0,0",
                            "1,2,3,4,5,6,7", "0,0,0,inf,0,0"}) {
    EXPECT_THAT(
        message_of([&] { cut_plane(wrong, {}); }),
        HasSubstr("--cut " + std::string(wrong) + ": allowed: a position [m] along an axis"))
        << wrong;
  }
}

TEST(Cut, LeavesOneSideOfASphereWithARoundOutline) {
  DrawnSurface ball = drawn(sphere({0, 0, 0}, 1, 60));
  const std::size_t before = ball.triangle.size();
  const CutPlane plane{{0, 0, 0.3}, {0, 0, 1}};
  const auto outlines = cut_away(ball, plane);
  ASSERT_EQ(outlines.size(), 1u);
  EXPECT_NEAR(area_of(outlines[0]), pi * (1 - 0.09), 0.01);
  for (const auto& edge : outlines[0].edges) EXPECT_NEAR(plane.height(edge[0]), 0, 1e-12);
  double area = 0;
  for (const auto& [a, b, c] : ball.triangle) {
    for (const Index i : {a, b, c}) EXPECT_LE(plane.height(ball.point[i]), 1e-12);
    area += 0.5 * norm(cross(ball.point[b] - ball.point[a], ball.point[c] - ball.point[a]));
  }
  EXPECT_NEAR(area, 2 * pi * 1.3, 0.02);  // a zone of the sphere, 1.3 high (Archimedes)
  EXPECT_LT(ball.triangle.size(), before);
  EXPECT_EQ(ball.normal.size(), ball.point.size());
  EXPECT_EQ(ball.colour.size(), ball.point.size());
  EXPECT_EQ(ball.body.size(), ball.point.size());
}

TEST(Cut, FacesTakeTheirAreaOnThePicture) {
  const CutPlane plane{{0, 0, 0.3}, {0, 0, 1}};
  DrawnSurface ball = drawn(sphere({0.2, -0.1, 0}, 1, 60));
  const auto outlines = cut_away(ball, plane);
  const double scale = 400 / (10 - 0.3);  // pixels per metre in the plane
  EXPECT_NEAR(face_pixels(outlines, plane, looking_down(10)), area_of(outlines[0]) * scale * scale,
              2);
  // From behind the plane there is no face, and outside the picture none either.
  Camera below = looking_down(-10);
  below.forward = {0, 0, 1};
  below.up = {0, -1, 0};
  EXPECT_EQ(face_pixels(outlines, plane, below), 0);
  Camera aside = looking_down(10);
  aside.eye.x = 100;
  EXPECT_EQ(face_pixels(outlines, plane, aside), 0);
}

TEST(Cut, FacesLeaveCavitiesOpenAndFillEachBody) {
  const CutPlane plane{{0, 0, 0}, {0, 0, 1}};
  const double scale = 400.0 / 10;
  DrawnSurface shell = drawn(sphere({0, 0, 0}, 1, 60));
  append(shell, drawn(sphere({0, 0, 0}, 0.5, 60)), true);
  EXPECT_NEAR(face_pixels(cut_away(shell, plane), plane, looking_down(10)),
              pi * (1 - 0.25) * scale * scale, 10);
  DrawnSurface two = drawn(sphere({-0.9, 0, 0}, 0.5, 60), 0);
  append(two, drawn(sphere({0.9, 0, 0}, 0.5, 60), 3));
  const auto outlines = cut_away(two, plane);
  ASSERT_EQ(outlines.size(), 2u);
  EXPECT_EQ(outlines[1].body, 3);
  EXPECT_NEAR(face_pixels(outlines, plane, looking_down(10)), 2 * pi * 0.25 * scale * scale, 10);
}

/// The camera is inside of what the plane cuts: parts of the outline lie behind it.
TEST(Cut, FacesReachBehindTheCamera) {
  const CutPlane plane{{0, 0, 0}, {0, 0, 1}};
  DrawnSurface ball = drawn(sphere({0, 0, 0}, 1000, 30));
  Camera camera{200, 160, {0, 0, 1}, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}, 400};
  // Half the picture, but for what lies beyond 995 m.
  EXPECT_NEAR(face_pixels(cut_away(ball, plane), plane, camera), 200 * 80, 200);
}

TEST(Cut, OpenSurfacesHaveNoFaces) {
  const CutPlane plane{{0, 0, 0}, {0, 0, 1}};
  DrawnSurface sheet;
  sheet.point = {{0, -1, -1}, {0, 1, -1}, {0, 1, 1}, {0, -1, 1}};
  sheet.normal.assign(4, Vec3d{1, 0, 0});
  sheet.colour.assign(4, grey);
  sheet.triangle = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_EQ(face_pixels(cut_away(sheet, plane), plane, looking_down(10)), 0);
}

/// Values inside are those of the phyxels around, of the same body.
TEST(Cut, PicturesShowTheFieldInside) {
  const FrameData ball = sphere({0, 0, 0}, 1, 40);
  FrameData phyxels;
  for (int i = -10; i <= 10; ++i) {
    for (int j = -10; j <= 10; ++j) {
      for (int k = -10; k <= 10; ++k) {
        const Vec3d x{0.1 * i, 0.1 * j, 0.1 * k};
        if (norm(x) > 1.01) continue;
        phyxels.point.push_back(x);
        phyxels.field["depth"].push_back(1 - norm(x));
      }
    }
  }
  const auto values =
      inner_values(phyxels, 0, "depth", {{0, 0, 0}, {0.55, 0, 0}}, carrier_reach(0.1));
  ASSERT_EQ(values.size(), 2u);
  EXPECT_NEAR(values[0], 0.92, 0.05);  // the mean over a kink
  EXPECT_NEAR(values[1], 0.45, 0.02);
  EXPECT_TRUE(inner_values(phyxels, 0, "mass", {{0, 0, 0}}, 0.16).empty());
  Setting setting;
  setting.camera = looking_down(10);
  setting.spacing = 0.1;
  setting.extent = 2;
  setting.time_decimals = -1;
  setting.colouring = Colouring{.field = "depth", .range = {0, 1}};
  setting.colouring->carriers = carriers_of(ball.point, phyxels.point, carrier_reach(0.1));
  const auto green = [&](int x, bool cuts) {
    if (cuts) setting.cut = CutPlane{{0, 0, 0}, {0, 0, 1}};
    if (!cuts) setting.cut.reset();
    return static_cast<int>(draw_picture(&ball, &phyxels, setting).pixel(x, 80)[1]);
  };
  // Viridis grows greener: the middle of the cut is deep inside, its rim is not. 40 px a metre.
  EXPECT_GT(green(100, true), green(100, false) + 80);
  EXPECT_GT(green(100, true), green(136, true) + 80);
  EXPECT_GT(green(136, true), 0);
  // Phyxels without a surface: what is in front of the plane is left out.
  setting.cut.reset();
  const Image whole = draw_picture(nullptr, &phyxels, setting);
  setting.cut = CutPlane{{0, 0, 0}, {0, 0, 1}};
  const Image half = draw_picture(nullptr, &phyxels, setting);
  EXPECT_GT(half.pixel(100, 80)[1], 120);
  EXPECT_NE(whole.rgb, half.rgb);
}

}  // namespace
}  // namespace phyxel::app
