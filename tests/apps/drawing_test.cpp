/// Drawing: projected positions, covered areas of triangles and dots, labels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "ball.hpp"
#include "compose.hpp"
#include "label.hpp"

namespace phyxel::app {
namespace {

using ::testing::HasSubstr;

/// A camera at the origin, looking along y with z up; 1 m at a depth of 10 m is `focal` / 10
/// pixels.
Camera camera_at_origin(int width, int height, double focal) {
  return {width, height, {0, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}, focal};
}

constexpr Colour black{0, 0, 0}, grey{0.5f, 0.5f, 0.5f}, red{0.8f, 0, 0}, blue{0, 0, 0.8f};
constexpr Vec3d to_camera{0, -1, 0};

Rasteriser on_black(const Camera& camera) { return {camera, {0, 0, 1}, black, black}; }

/// A mesh of one colour, one normal and one body.
struct Patch {
  std::vector<Vec3d> point;
  std::vector<Triangle> triangle;
  Colour colour = grey;
  Vec3d normal = to_camera;
  Index body = 0;

  void draw(Rasteriser& rasteriser) const {
    rasteriser.draw_surface(point, std::vector(point.size(), normal), triangle,
                            std::vector(point.size(), colour), std::vector(point.size(), body));
  }
};

/// The rectangle [x0, x1] x [z0, z1] at a depth, facing the camera.
Patch rectangle(double x0, double x1, double z0, double z1, double depth, Colour colour = grey) {
  return {{{x0, depth, z0}, {x1, depth, z0}, {x1, depth, z1}, {x0, depth, z1}},
          {{0, 1, 2}, {0, 2, 3}},
          colour};
}

Image image_of(const Camera& camera, std::initializer_list<Patch> patches) {
  Rasteriser rasteriser = on_black(camera);
  for (const Patch& patch : patches) patch.draw(rasteriser);
  return rasteriser.resolve();
}

int brightness(const Image& image, int x, int y) {
  const std::uint8_t* p = image.pixel(x, y);
  return p[0] + p[1] + p[2];
}

int lit_pixels(const Image& image) {
  int count = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) count += brightness(image, x, y) > 0;
  }
  return count;
}

// --- camera ------------------------------------------------------------------------------------

TEST(Camera, KnownPointsLandOnKnownPixels) {
  const Camera camera = camera_at_origin(200, 100, 80);
  const struct {
    Vec3d point;
    double x, y, depth;
  } table[] = {{{0, 10, 0}, 100, 50, 10},
               {{1, 10, 0}, 108, 50, 10},
               {{0, 10, 1}, 100, 42, 10},
               {{-2, 20, -4}, 92, 66, 20}};
  for (const auto& row : table) {
    const Camera::Place place = camera.project(row.point);
    EXPECT_DOUBLE_EQ(place.x, row.x);
    EXPECT_DOUBLE_EQ(place.y, row.y);
    EXPECT_DOUBLE_EQ(place.depth, row.depth);
  }
  EXPECT_LT(camera.project({0, -1, 0}).depth, 0);  // behind
}

TEST(Camera, TheFitIsTheTightestThatShowsEveryPoint) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const auto& [width, height] : {std::pair{960, 720}, {300, 900}, {64, 64}}) {
    for (const Vec3d view : {Vec3d{-1, 2, -0.6}, {0, 0, -1}, {0, 0, 5}, {1, 0, 0}}) {
      std::vector<Vec3d> points(50);
      for (Vec3d& p : points) {
        p = {3 + 2 * uniform(random), uniform(random), 0.3 * uniform(random) - 8};
      }
      CameraFit fit(width, height, view, {0, 0, 1});
      fit.include(points);
      const Camera camera = fit.camera();
      double across = 0, down = 0;
      for (const Vec3d& p : points) {
        const Camera::Place place = camera.project(p);
        EXPECT_GT(place.depth, 0);
        across = std::max(across, std::abs(place.x / width - 0.5));
        down = std::max(down, std::abs(place.y / height - 0.5));
      }
      // A margin of 7% remains on each side; the tighter direction is filled up to it.
      EXPECT_NEAR(std::max(across, down), 0.43, 1e-9);
      // The axes are orthonormal and right-handed: right x up = -forward.
      EXPECT_NEAR(norm(camera.right), 1, 1e-12);
      EXPECT_NEAR(norm(cross(camera.right, camera.up) + camera.forward), 0, 1e-12);
      EXPECT_NEAR(norm(camera.forward - normalised(view)), 0, 1e-12);
    }
  }
}

TEST(Camera, UpIsUpOnThePicture) {
  CameraFit fit(100, 100, {-1, 2, -0.6}, {0, 0, 1});
  fit.include(std::vector<Vec3d>{{0, 0, 0}, {0, 0, 1}});
  const Camera camera = fit.camera();
  EXPECT_LT(camera.project({0, 0, 1}).y, camera.project({0, 0, 0}).y - 10);
  EXPECT_NEAR(camera.project({0, 0, 1}).x, camera.project({0, 0, 0}).x, 1e-9);
}

TEST(Camera, ASinglePointIsInTheMiddleAndPointsThatAreNotFiniteAreSkipped) {
  CameraFit fit(200, 100, {0, 1, 0}, {0, 0, 1});
  EXPECT_TRUE(fit.empty());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  fit.include(std::vector<Vec3d>{{nan, 0, 0}, {0, std::numeric_limits<double>::infinity(), 0}});
  EXPECT_TRUE(fit.empty());
  fit.include(std::vector<Vec3d>{{1e6, -3, 5}});
  EXPECT_FALSE(fit.empty());
  EXPECT_EQ(fit.extent(), 0);
  const Camera::Place place = fit.camera().project({1e6, -3, 5});
  EXPECT_NEAR(place.x, 100, 1e-6);
  EXPECT_NEAR(place.y, 50, 1e-6);
  EXPECT_GT(place.depth, 0);
}

TEST(Camera, ImpossibleViewsAreRefused) {
  EXPECT_THAT(message_of([] {
                CameraFit(15, 100, {0, 1, 0}, {0, 0, 1});
              }),
              HasSubstr("15 x 100 pixels: allowed from 16 x 16 to 16384 x 16384"));
  EXPECT_THROW(CameraFit(100, 16385, {0, 1, 0}, {0, 0, 1}), InputError);
  EXPECT_THROW(CameraFit(100, 100, {0, 0, 0}, {0, 0, 1}), InputError);
  EXPECT_THROW(CameraFit(100, 100, {0, std::nan(""), 0}, {0, 0, 1}), InputError);
  EXPECT_THROW(CameraFit(100, 100, {0, 1, 0}, {0, 0, INFINITY}), InputError);
}

// --- surface -----------------------------------------------------------------------------------

TEST(Surface, ATriangleCoversItsArea) {
  // At depth 10, 100 px a metre: legs of 600 and 400 px, 120,000 px².
  const Patch triangle{{{-3, 10, -2}, {3, 10, -2}, {-3, 10, 2}}, {{0, 1, 2}}};
  const int lit = lit_pixels(image_of(camera_at_origin(800, 600, 1000), {triangle}));
  // Pixels count when any of their samples is covered; the slanted side crosses fewer than 1000.
  EXPECT_GE(lit, 120000);
  EXPECT_LE(lit, 121000);
}

TEST(Surface, NeighbouringTrianglesLeaveNoGap) {
  // A fan of 40 triangles around a point off every pixel's centre.
  Patch fan;
  fan.point.push_back({0.0123, 10, -0.0456});
  for (int k = 0; k < 40; ++k) {
    const double angle = 2 * std::numbers::pi * k / 40;
    fan.point.push_back({std::cos(angle), 10, std::sin(angle)});
    fan.triangle.push_back({0, k + 1, (k + 1) % 40 + 1});
  }
  const Image image = image_of(camera_at_origin(240, 240, 1000), {fan});
  const int middle = brightness(image, 120, 120);
  ASSERT_GT(middle, 0);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 240; ++x) {
      // Shading varies slowly over the patch; a gap of one sample in nine would darken by more.
      if (std::hypot(x - 119.5, y - 119.5) < 97) {
        EXPECT_NEAR(brightness(image, x, y), middle, 4) << x << ' ' << y;
      }
    }
  }
}

TEST(Surface, ARectangleOnPixelEdgesIsSharpAndSmoothInBetween) {
  // 100 px a metre: columns 40 to 59 and rows 30 to 49 exactly.
  const Image sharp =
      image_of(camera_at_origin(100, 80, 1000), {rectangle(-0.1, 0.1, -0.1, 0.1, 10)});
  EXPECT_EQ(lit_pixels(sharp), 400);
  EXPECT_EQ(brightness(sharp, 39, 40), 0);
  // The diagonal that the two triangles share runs through the centres of samples.
  for (int k = 0; k < 20; ++k) {
    EXPECT_NEAR(brightness(sharp, 40 + k, 49 - k), brightness(sharp, 50, 35), 4) << k;
  }
  // A third of a pixel further left: column 39 is covered by a third.
  const Image smooth =
      image_of(camera_at_origin(100, 80, 1000), {rectangle(-0.1 - 0.01 / 3, 0.1, -0.1, 0.1, 10)});
  EXPECT_GT(brightness(smooth, 39, 40), brightness(smooth, 40, 40) / 3);
  EXPECT_LT(brightness(smooth, 39, 40), brightness(smooth, 40, 40) * 2 / 3);  // sRGB: 0.61
}

TEST(Surface, TheNearerHidesTheFartherInAnyOrder) {
  const Camera camera = camera_at_origin(100, 80, 1000);
  const Patch near = rectangle(-0.1, 0.1, -0.1, 0.1, 10, red);
  const Patch far = rectangle(-0.2, 0.2, -0.2, 0.2, 11, blue);
  const Image image = image_of(camera, {near, far});
  EXPECT_EQ(image.rgb, image_of(camera, {far, near}).rgb);
  EXPECT_GT(image.pixel(50, 40)[0], 10 + image.pixel(50, 40)[2]);
  EXPECT_GT(image.pixel(35, 40)[2], 10 + image.pixel(35, 40)[0]);
}

TEST(Surface, SlantedSurfacesMeetWhereTheyDoInSpace) {
  // Depth 10 + x/4 and 10 - x/4 cross at x = 0, in the middle of the picture.
  Patch left = rectangle(-0.4, 0.4, -0.2, 0.2, 10, red), right = left;
  right.colour = blue;
  for (Vec3d& p : left.point) p.y += 0.25 * p.x;
  for (Vec3d& p : right.point) p.y -= 0.25 * p.x;
  const Image image = image_of(camera_at_origin(100, 80, 1000), {left, right});
  for (int y = 25; y < 55; ++y) {
    EXPECT_GT(image.pixel(48, y)[0], image.pixel(48, y)[2]) << y;
    EXPECT_LT(image.pixel(51, y)[0], image.pixel(51, y)[2]) << y;
  }
}

TEST(Surface, FacesTurnedToTheLightAreBrighter) {
  // The light comes from above, left, and the viewer's side.
  const auto lit = [](Vec3d normal) {
    Patch patch = rectangle(-0.1, 0.1, -0.1, 0.1, 10);
    patch.normal = normalised(normal);
    return brightness(image_of(camera_at_origin(40, 40, 1000), {patch}), 20, 20);
  };
  EXPECT_GT(lit({-0.4, -1, 0.6}), lit({0, -1, 0}) + 10);
  EXPECT_GT(lit({0, -1, 0}), lit({0.4, -1, -0.6}) + 10);
  EXPECT_GT(lit({0, -1, 0.8}), lit({0, -1, -0.8}) + 10);
}

TEST(Surface, TheBackIsLitAsAFaceOfItsOwn) {
  Patch front = rectangle(-0.1, 0.1, -0.1, 0.1, 10), back = front;
  for (Triangle& t : back.triangle) std::swap(t[1], t[2]);
  back.normal = -front.normal;
  const Camera camera = camera_at_origin(40, 40, 1000);
  EXPECT_EQ(image_of(camera, {front}).rgb, image_of(camera, {back}).rgb);
}

TEST(Surface, WhatCannotBeSeenIsLeftOut) {
  const double nan = std::nan(""), inf = INFINITY;
  Patch odd;
  odd.point = {{0, -10, 0},  {1, -10, 0},  {0, -10, 1},    // behind the camera
               {0, 10, 0},   {1, 10, 0},   {nan, 10, 1},   // not a number
               {inf, 10, 0}, {0, inf, 0},  {0, 0, 0},      // infinite, and in the eye
               {1e9, 10, 0}, {1e9, 10, 1}, {2e9, 10, 0}};  // far beside the picture
  odd.triangle = {{0, 1, 2}, {3, 4, 5}, {3, 4, 6},   {3, 4, 7},
                  {3, 4, 8}, {3, 4, 0}, {9, 10, 11}, {3, 3, 4}};  // the last has no area
  EXPECT_EQ(lit_pixels(image_of(camera_at_origin(40, 40, 1000), {odd})), 0);
}

TEST(Surface, ASphereHasItsSilhouetteRadius) {
  // R = 1 at distance 5 is seen under the angle asin(1/5): f R / sqrt(25 - 1) = 122.5 px.
  const double radius = 600 / std::sqrt(24.0);
  const FrameData ball = sphere({0, 5, 0}, 1, 90);
  Rasteriser rasteriser = on_black(camera_at_origin(320, 320, 600));
  rasteriser.draw_surface(ball.point, ball.normal, ball.triangle,
                          std::vector(ball.point.size(), grey), {});
  const double area = lit_pixels(rasteriser.resolve());
  // Pixels partly covered count: half a pixel of radius; the polygon's sagitta is 0.02 px.
  EXPECT_NEAR(std::sqrt(area / std::numbers::pi), radius + 0.5, 0.4);
}

TEST(Surface, HollowsAreDarkerThanPlanesAndRidges) {
  // Two faces that meet at x = 0: a valley, a plane or a ridge, with the same normals throughout.
  const auto middle = [](double slope, bool hollows) {
    Patch patch;
    patch.point = {{-1, 10 - slope, -1}, {0, 10, -1}, {1, 10 - slope, -1},
                   {-1, 10 - slope, 1},  {0, 10, 1},  {1, 10 - slope, 1}};
    patch.triangle = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
    Rasteriser rasteriser = on_black(camera_at_origin(100, 100, 400));
    patch.draw(rasteriser);
    if (hollows) rasteriser.shade_hollows(0.3);
    return brightness(rasteriser.resolve(), 50, 50);
  };
  EXPECT_LT(middle(1, true), middle(1, false) - 20);
  EXPECT_EQ(middle(0, true), middle(0, false));
  EXPECT_EQ(middle(-1, true), middle(-1, false));
}

TEST(Surface, WhatIsFarInFrontCastsNoHalo) {
  Rasteriser rasteriser = on_black(camera_at_origin(100, 100, 400));
  rectangle(-2, 2, -2, 2, 10).draw(rasteriser);
  rectangle(-0.5, 0, -0.5, 0.5, 5).draw(rasteriser);  // its right edge is in column 50
  const int bare = brightness(rasteriser.resolve(), 52, 50);
  rasteriser.shade_hollows(0.3);
  EXPECT_EQ(brightness(rasteriser.resolve(), 52, 50), bare);
}

// --- phyxels -----------------------------------------------------------------------------------

TEST(Dots, BallsHaveTheirProjectedSize) {
  Rasteriser rasteriser = on_black(camera_at_origin(200, 200, 1000));
  DotStyle style;
  style.radius = 0.5;  // 50 px at depth 10
  rasteriser.draw_spheres(std::vector<Vec3d>{{0, 10, 0}}, std::vector{grey}, {}, style);
  EXPECT_NEAR(std::sqrt(lit_pixels(rasteriser.resolve()) / std::numbers::pi), 50.5, 0.4);
}

TEST(Dots, NoDotIsTooSmallToBeSeen) {
  Rasteriser rasteriser = on_black(camera_at_origin(100, 100, 1000));
  DotStyle style;
  style.radius = 1e-9;
  rasteriser.draw_spheres(std::vector<Vec3d>{{0, 10, 0}, {0.2, 10, 0.2}}, std::vector{grey, grey},
                          {}, style);
  const Image image = rasteriser.resolve();
  EXPECT_GT(brightness(image, 50, 50) + brightness(image, 49, 49), 0);
  EXPECT_GT(brightness(image, 70, 30) + brightness(image, 69, 29), 0);
}

/// Red channel where a white dot of body 0 lies `below` the black surface of body `surface_body`.
int dot_shine(double below, Index surface_body) {
  Patch surface = rectangle(-0.3, 0.3, -0.3, 0.3, 10, black);
  surface.body = surface_body;
  Rasteriser rasteriser = on_black(camera_at_origin(40, 40, 400));
  surface.draw(rasteriser);
  const Image bare = rasteriser.resolve();
  DotStyle style;
  style.radius = 0.1;
  style.fade = 1;
  rasteriser.draw_dots(std::vector<Vec3d>{{0, 10 + below, 0}}, std::vector{Colour{1, 1, 1}}, {},
                       style);
  return brightness(rasteriser.resolve(), 20, 20) - brightness(bare, 20, 20);
}

TEST(Dots, ShineThroughTheirOwnSurfaceTheFainterTheDeeper) {
  EXPECT_GT(dot_shine(-0.2, 0), dot_shine(0.1, 0));
  EXPECT_GT(dot_shine(0.1, 0), dot_shine(0.5, 0) + 20);
  EXPECT_GT(dot_shine(0.5, 0), dot_shine(2, 0) + 20);
  EXPECT_GT(dot_shine(50, 0), 0);  // never lost altogether
}

TEST(Dots, AreHiddenByOtherBodies) {
  EXPECT_EQ(dot_shine(0.1, 1), 0);
  EXPECT_GT(dot_shine(-0.2, 1), 100);  // in front of it
}

TEST(Dots, TypicalSpacingIsThatOfALattice) {
  std::vector<Vec3d> lattice;
  for (int k = 0; k < 1000; ++k) {
    lattice.push_back({0.25 * (k % 10), 0.25 * (k / 10 % 10), 0.25 * (k / 100)});
  }
  EXPECT_DOUBLE_EQ(typical_spacing(lattice), 0.25);
  EXPECT_EQ(typical_spacing({}), 0);
  EXPECT_EQ(typical_spacing({{1, 2, 3}}), 0);
}

// --- colours and labels ------------------------------------------------------------------------

TEST(Colours, FollowThePublishedSpaces) {
  // The sRGB red primary in OKLCH (Ottosson 2020, rounded to 4 digits).
  const Colour primary = oklch(0.6280, 0.2577, 29.23);
  EXPECT_NEAR(primary.x, 1, 2e-3);
  EXPECT_NEAR(primary.y, 0, 2e-3);
  EXPECT_NEAR(primary.z, 0, 2e-3);
  const Colour white = oklch(1, 0, 0);
  EXPECT_NEAR(white.x + white.y + white.z, 3, 1e-5);
  // IEC 61966-2-1: linear 0.2140 is half of the encoded range.
  EXPECT_EQ(encode(0), 0);
  EXPECT_EQ(encode(1), 255);
  EXPECT_EQ(encode(2), 255);
  EXPECT_EQ(encode(-1), 0);
  EXPECT_EQ(encode(0.2140f), 127);
}

TEST(Colours, TenBodiesDiffer) {
  for (Index a = 0; a < 10; ++a) {
    for (Index b = 0; b < a; ++b) {
      int difference = 0;
      const Colour p = body_colour(a), q = body_colour(b);
      for (const auto& [u, v] : {std::pair{p.x, q.x}, {p.y, q.y}, {p.z, q.z}}) {
        difference += std::abs(encode(u) - encode(v));
      }
      EXPECT_GE(difference, 25) << a << ' ' << b;  // 10 of 255 in one channel are seen side by side
    }
  }
}

TEST(Label, TextIsDrawnWhereItBelongsAndIsReadable) {
  const auto draw = [](std::string_view text) {
    Image image{200, 60, std::vector<std::uint8_t>(3 * 200 * 60, 255)};
    draw_text(image, 20, 10, 3, text);
    return image;
  };
  std::vector<Image> digits;
  for (const char c : std::string("0123456789.=ts")) {
    const Image image = draw({&c, 1});
    int dark = 0;
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 200; ++x) {
        // A 5 x 7 font at 3 px a dot.
        const bool inside = x >= 20 && x < 35 && y >= 10 && y < 31;
        ASSERT_TRUE(inside || image.pixel(x, y)[0] == 255) << c << ' ' << x << ' ' << y;
        dark += image.pixel(x, y)[0] < 120;
      }
    }
    EXPECT_GT(dark, 8) << c;  // at least about two dots of 3 x 3 px
    for (const Image& other : digits) EXPECT_NE(image.rgb, other.rgb) << c;
    digits.push_back(image);
  }
  EXPECT_EQ(draw(" ").rgb, std::vector<std::uint8_t>(3 * 200 * 60, 255));
}

TEST(Label, IsCutOffAtTheEdges) {
  Image image{16, 16, std::vector<std::uint8_t>(3 * 16 * 16, 255)};
  draw_text(image, -10, -5, 4, "88888");
  draw_text(image, 10, 12, 4, "88888");
  EXPECT_LT(*std::min_element(image.rgb.begin(), image.rgb.end()), 120);
}

}  // namespace
}  // namespace phyxel::app
