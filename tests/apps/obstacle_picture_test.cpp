/// Obstacles in pictures: where they are, what hides them and what they hide, and shadows.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "ball.hpp"
#include "compose.hpp"
#include "model/contact.hpp"
#include "scene/parse_obstacles.hpp"
#include "shadow.hpp"

namespace phyxel::app {
namespace {

/// The obstacles of a scene whose body is in a file that is gone.
std::vector<Obstacle> obstacles(const std::string& text) {
  return obstacles_of(parse_obstacles("[[body]]\nmesh = \"gone.obj\"\n" + text, "scene.toml"));
}

/// A camera at the origin that looks along y with z up, 240 x 240 px; bodies are about `middle`.
Setting setting_of(Vec3d middle, const std::string& text) {
  Setting setting;
  setting.camera = {240, 240, {0, 0, 0}, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}, 600};
  setting.extent = 4;
  setting.middle = middle;
  setting.time_decimals = -1;
  setting.obstacles = obstacles(text);
  return setting;
}

/// Where a picture differs from the same without obstacles: the pixels' number and centre.
struct Difference {
  int count = 0;
  double x = 0, y = 0;  // [px]
};

Difference difference(const Image& a, const Image& b) {
  Difference d;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) {
      if (std::equal(a.pixel(x, y), a.pixel(x, y) + 3, b.pixel(x, y))) continue;
      ++d.count;
      d.x += x + 0.5;
      d.y += y + 0.5;
    }
  }
  d.x /= std::max(d.count, 1);
  d.y /= std::max(d.count, 1);
  return d;
}

/// The picture of an empty frame at a time, with a setting's obstacles and without.
Difference seen_of_obstacles(Setting setting, double time = 0) {
  FrameData nothing;
  nothing.time = time;
  const Image with = draw_picture(&nothing, nullptr, setting);
  setting.obstacles.clear();
  return difference(with, draw_picture(&nothing, nullptr, setting));
}

int brightness(const Image& image, Vec3d place, const Camera& camera) {
  const Camera::Place at = camera.project(place);
  const std::uint8_t* p = image.pixel(static_cast<int>(at.x), static_cast<int>(at.y));
  return p[0] + p[1] + p[2];
}

bool is_green(const Image& image, int x, int y) {
  const std::uint8_t* p = image.pixel(x, y);
  return p[1] > 15 + std::max(p[0], p[2]);
}

TEST(Obstacles, ASphereHasItsProjectedSizeAndFollowsItsPath) {
  // R = 0.5 at distance 5 is seen under the angle asin(0.1): f R / sqrt(25 - 0.25) = 60.3 px.
  const Setting setting = setting_of({0, 5, 0}, R"([[obstacle]]
shape = "sphere"
radius = 0.5
translation = [0, 5, 0]
[obstacle.motion]
velocity = [0.25, 0, 0])");
  const Difference rest = seen_of_obstacles(setting);
  EXPECT_NEAR(std::sqrt(rest.count / std::numbers::pi), 600 * 0.5 / std::sqrt(24.75) + 0.5, 0.6);
  EXPECT_NEAR(rest.x, 120, 0.2);
  EXPECT_NEAR(rest.y, 120, 0.2);
  // 0.5 m to the right at depth 5 is 60 px; perspective stretches the disc by about a pixel.
  EXPECT_NEAR(seen_of_obstacles(setting, 2).x, 180, 1);
}

TEST(Obstacles, EveryShapeCoversItsOutline) {
  const struct {
    const char* shape;
    double area;  // [m²]
  } table[] = {{"shape = \"box\"\nsize = [0.6, 1e-3, 0.4]", 0.24},
               {"shape = \"cylinder\"\nradius = 0.2\nlength = 0.6", 0.24},
               {"shape = \"capsule\"\nradius = 0.2\nlength = 0.4", 0.16 + 0.04 * std::numbers::pi}};
  for (const auto& row : table) {
    const std::string text = std::string("[[obstacle]]\ntranslation = [0, 50, 0]\n") + row.shape;
    Setting setting = setting_of({0, 50, 0}, text);
    setting.camera.focal = 10000;  // 200 px a metre, nearly parallel rays
    const double area = row.area * 200 * 200;
    // Pixels count when any of their samples is covered: half the outline of at most 500 px.
    EXPECT_NEAR(seen_of_obstacles(setting).count, area + 150, 160) << row.shape;
  }
}

TEST(Obstacles, TheNearerHidesTheFarther) {
  FrameData ball = sphere({0, 10, 0}, 0.5, 30);
  const auto middle_is_green = [&](double depth) {
    const std::string place = "[0, " + std::to_string(depth) + ", 0]";
    const Setting setting = setting_of(
        {0, 10, 0}, "[[obstacle]]\nshape = \"sphere\"\nradius = 0.3\ntranslation = " + place);
    return is_green(draw_picture(&ball, nullptr, setting), 120, 120);
  };
  EXPECT_FALSE(middle_is_green(9));
  EXPECT_TRUE(middle_is_green(11));
}

TEST(Obstacles, PlanesAreSeenFromTheirFrontAndHollowBoxesFromWithin) {
  const auto plane = [](const char* normal) {
    return seen_of_obstacles(setting_of({0, 8, 0}, std::string(R"([[obstacle]]
shape = "plane"
translation = [0, 9, 0]
normal = )") + normal))
        .count;
  };
  EXPECT_EQ(plane("[0, -1, 0]"), 240 * 240);
  EXPECT_EQ(plane("[0, 1, 0]"), 0);

  // Of a hollow box between depths 4 and 6, the wall at 6 is seen: 1 m wide, 100 px. From its
  // front wall at 4 it would be 150 px. Its side walls are seen in between, from within.
  FrameData ball = sphere({0, 5, 0}, 0.3, 30);
  const Setting bin = setting_of({0, 5, 0}, R"([[obstacle]]
shape = "box"
hollow = true
size = [1, 2, 1]
translation = [0, 5, 0])");
  EXPECT_TRUE(is_green(draw_picture(&ball, nullptr, bin), 120, 120));
  EXPECT_NEAR(std::sqrt(seen_of_obstacles(bin).count), 150, 2);
}

TEST(Obstacles, AFloorHasNoHorizon) {
  const Setting setting = setting_of({0, 10, 0}, R"([[obstacle]]
shape = "plane"
translation = [0, 0, -1])");
  FrameData nothing;
  const Image image = draw_picture(&nothing, nullptr, setting);
  int floor = 0;
  for (int y = 1; y < 240; ++y) {
    const auto at = [&](int row) { return static_cast<int>(image.pixel(120, row)[0]); };
    EXPECT_LE(std::abs(at(y) - at(y - 1)), 6) << y;
    floor += image.pixel(120, y)[0] > image.pixel(120, y)[2];  // its colour is warmer
  }
  EXPECT_GT(floor, 40);
}

TEST(Shadows, FallAlongTheLight) {
  Setting setting = setting_of({0, 10, 0}, R"([[obstacle]]
shape = "plane"
translation = [0, 0, -1])");
  setting.camera.focal = 400;
  const FrameData ball = sphere({0, 10, 0}, 0.3, 40);
  const FrameData aside = sphere({-1.5, 10, 0}, 0.3, 40);
  const Vec3d light = light_direction(setting.camera, setting.up);
  EXPECT_GT(light.z, 0.8);
  const Vec3d on_floor = Vec3d{0, 10, 0} - (1 / light.z) * light;
  const Image shaded = draw_picture(&ball, nullptr, setting);
  const Image bare = draw_picture(&aside, nullptr, setting);
  const auto darkening = [&](Vec3d place) {
    return brightness(bare, place, setting.camera) - brightness(shaded, place, setting.camera);
  };
  EXPECT_GT(darkening(on_floor), 60);
  // Its edge is soft, and it is as wide as the ball but for that.
  const double full = darkening(on_floor);
  const double edge = darkening(on_floor + Vec3d{0.32, 0, 0});
  EXPECT_GT(edge, 0.1 * full);
  EXPECT_LT(edge, 0.9 * full);
  EXPECT_NEAR(darkening(on_floor + Vec3d{0.6, 0, 0}), 0, 3);
  EXPECT_EQ(shaded.rgb, draw_picture(&ball, nullptr, setting).rgb);
}

TEST(Shadows, FallFromObstaclesOnBodies) {
  const FrameData ball = sphere({0, 10, 0}, 0.5, 40);
  Setting setting = setting_of({0, 10, 0}, R"([[obstacle]]
shape = "box"
size = [3, 3, 0.1]
translation = [0, 10, 1.8])");
  const Image shaded = draw_picture(&ball, nullptr, setting);
  setting.obstacles.clear();
  const Image bare = draw_picture(&ball, nullptr, setting);
  const Vec3d front{0, 9.5, 0};
  EXPECT_LT(brightness(shaded, front, setting.camera),
            0.85 * brightness(bare, front, setting.camera));
}

TEST(Obstacles, AreOfTheSceneThatNamesThem) {
  const auto found = obstacles(
      "[[obstacle]]\nshape = \"sphere\"\nradius = 2\n"
      "[[obstacle]]\nshape = \"plane\"");
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].form.lengths[0], 2);
  EXPECT_TRUE(obstacles("").empty());
}

}  // namespace
}  // namespace phyxel::app
