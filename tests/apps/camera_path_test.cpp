/// Cameras of pictures: what scenes and options wish, orbits, bodies that are followed.
#include "camera_path.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "ball.hpp"
#include "png_reader.hpp"
#include "report/opening_view.hpp"
#include "support/thrown_block.hpp"

namespace phyxel::app {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

void expect_near(Vec3d found, Vec3d wanted, double tolerance = 1e-12) {
  EXPECT_NEAR(norm(found - wanted), 0, tolerance) << found.x << ", " << found.y << ", " << found.z;
}

CameraWishes wishes_of(const std::string& render) {
  return camera_wishes(render +
                           "\n[time]\nend = 1\n[[body]]\ncloud = \"c\"\nname = \"ball\"\n"
                           "material = { young = 1, poisson = 0.3, density = 1 }\n",
                       "scene.toml");
}

TEST(CameraWishes, AreThoseOfTheSceneUnlessOptionsReplaceThem) {
  const CameraWishes scene = wishes_of(
      "[render]\nup = [0, 1, 0]\n[render.camera]\nposition = [4, 0, 0]\ntarget = [1, 0, 0]\n"
      "field_of_view = 50\norbit = 90\nfollow = 'ball'");
  expect_near(scene.view, {-3, 0, 0});
  expect_near(scene.up, {0, 1, 0});
  EXPECT_EQ(scene.camera.field_of_view, 50);
  EXPECT_EQ(scene.camera.orbit, 90);
  EXPECT_EQ(scene.camera.follow, "ball");
  const CameraWishes same = with_options(scene, {});
  expect_near(*same.camera.position, {4, 0, 0});
  expect_near(same.view, {-3, 0, 0});
  const CameraWishes turned = with_options(scene, {.view = Vec3d{0, 0, -1}});
  EXPECT_FALSE(turned.camera.position || turned.camera.target);
  expect_near(turned.view, {0, 0, -1});
  const CameraWishes moved = with_options(scene, {.position = Vec3d{1, 0, 7}});
  expect_near(moved.view, {0, 0, -7});
  const CameraWishes plain =
      with_options(scene, {.up = Vec3d{0, 0, 1}, .field_of_view = 20, .orbit = 0, .follow = ""});
  expect_near(plain.up, {0, 0, 1});
  EXPECT_EQ(plain.camera.field_of_view, 20);
  EXPECT_EQ(plain.camera.orbit, 0);
  EXPECT_THAT(plain.camera.follow, IsEmpty());
  EXPECT_THAT(message_of([&] {
                with_options(scene, {.target = Vec3d{4, 0, 0}});
              }),
              HasSubstr("--target 4,0,0: the place of the camera"));
  EXPECT_THAT(message_of([&] {
                with_options(
                    scene,
                    {.view = Vec3d{1, 0, 0}, .position = Vec3d{0, 0, 0}, .target = Vec3d{1, 0, 0}});
              }),
              HasSubstr("--view beside --position and --target"));
  EXPECT_EQ(camera_wishes("", "none").camera.field_of_view, 30);
}

/// The cameras of five pictures of a ball.
std::vector<Camera> path_of(const CameraWishes& wishes) {
  const FrameData ball = sphere({1, 2, 3}, 0.5, 20);
  CameraFit fit(400, 300, wishes.view, wishes.up, wishes.camera.field_of_view);
  fit.include(ball.point);
  return camera_path(wishes, fit, ball.point, 5);
}

/// The share of the picture's height that half the ball takes at most.
double share_of_ball(const Camera& camera) {
  double largest = 0;
  for (const Vec3d& p : sphere({1, 2, 3}, 0.5, 20).point) {
    const Camera::Place place = camera.project(p);
    EXPECT_GT(place.depth, 0);
    largest = std::max(largest, std::abs(place.y / 300 - 0.5));
  }
  return largest;
}

TEST(CameraPath, StandsWhereItIsPlaced) {
  CameraWishes wishes;
  wishes.camera.position = Vec3d{5, 2, 3};
  wishes.camera.target = Vec3d{1, 2, 4};
  wishes.camera.field_of_view = 60;
  wishes.view = *wishes.camera.target - *wishes.camera.position;
  const Camera camera = path_of(wishes)[3];
  expect_near(camera.eye, {5, 2, 3});
  const Camera::Place middle = camera.project({1, 2, 4});
  EXPECT_NEAR(middle.x, 200, 1e-9);
  EXPECT_NEAR(middle.y, 150, 1e-9);
  // 60 degrees from the lower to the upper edge.
  const Vec3d edge = camera.eye + camera.forward + std::tan(std::numbers::pi / 6) * camera.up;
  EXPECT_NEAR(camera.project(edge).y, 0, 1e-9);
}

TEST(CameraPath, SeesAllAroundATarget) {
  CameraWishes wishes;
  wishes.camera.target = Vec3d{1, 2, 2.5};
  const Camera camera = path_of(wishes)[0];
  EXPECT_NEAR(camera.project({1, 2, 2.5}).x, 200, 1e-9);
  EXPECT_NEAR(camera.project({1, 2, 2.5}).y, 150, 1e-9);
  EXPECT_NEAR(share_of_ball(camera), 0.43, 1e-9);
}

TEST(CameraPath, OrbitsKeepTheirDistanceAndEndAfterTheirAngle) {
  CameraWishes wishes;
  wishes.view = {0, 1, 0};
  wishes.camera.orbit = 90;
  for (const bool is_placed : {false, true}) {
    const Vec3d target{1, 2, 3};
    if (is_placed) {
      wishes.camera.position = Vec3d{1, -4, 5};
      wishes.camera.target = target;
      wishes.view = target - *wishes.camera.position;
    }
    const std::vector<Camera> path = path_of(wishes);
    for (const Camera& camera : path) {
      EXPECT_NEAR(camera.project(target).x, 200, 1e-6);
      EXPECT_NEAR(camera.project(target).y, 150, 1e-6);
      EXPECT_NEAR(norm(camera.eye - target), norm(path[0].eye - target), 1e-9);
      EXPECT_LT(share_of_ball(camera), 0.431);
    }
    const Vec3d start = path.front().forward, end = path.back().forward;
    expect_near(end, {-start.y, start.x, start.z});  // a quarter turn about z
    if (is_placed) {
      expect_near(path.front().eye, {1, -4, 5});
      expect_near(path.back().eye, {7, 2, 5});
    }
  }
}

TEST(FollowedBody, HasTheWayOfItsCentre) {
  FrameData frame;
  frame.point = {{0, 0, 0}, {1, 0, 0}, {5, 5, 5}, {7, 5, 5}};
  frame.body = {0, 0, 1, 1};
  expect_near(*centre_of(frame, 1), {6, 5, 5});
  EXPECT_FALSE(centre_of(frame, 2));
  const std::string scene =
      "[time]\nend = 1\n[[body]]\ncloud = 'a'\nmaterial = { young = 1, poisson = 0.3, density = 1 "
      "}\n"
      "[[body]]\ncloud = 'b'\nmaterial = { young = 1, poisson = 0.3, density = 1 }\n";
  EXPECT_EQ(body_called("b", scene, "scene.toml"), 1);
  EXPECT_THAT(message_of([&] { body_called("c", scene, "scene.toml"); }),
              HasSubstr("--follow c: no body is called that; allowed: a, b"));
  EXPECT_THAT(message_of([&] { body_called("c", "", "scene.toml"); }),
              HasSubstr("the camera follows \"c\", but the scene in the frames cannot be read"));
  FollowedBody body("b", scene, "scene.toml");
  body.add(nullptr, &frame);
  for (Vec3d& p : frame.point) p += Vec3d{0, 2, 0};
  body.add(&frame, nullptr);
  expect_near(body.way(0), {0, 0, 0});
  expect_near(body.way(1), {0, 2, 0});
  frame.body = {0, 0, 0, 0};
  EXPECT_THAT(message_of([&] { body.add(nullptr, &frame); }),
              HasSubstr("--follow b: frame 2 has no point of it"));
}

TEST(FollowedBody, HasTheWayOfARigidOne) {
  const auto folder = std::filesystem::temp_directory_path() / "phyxel_followed_rigid";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "rigid.csv")
      << "time [s],step,obstacle,place_x [m],place_y [m],place_z [m],rotation_x [rad],"
         "rotation_y [rad],rotation_z "
         "[rad]\n0,0,\"ball\",1,2,3,0,0,0\n0.5,10,\"ball\",1,2,5,0,0,1\n";
  const std::string scene =
      "[time]\nend = 1\n[[body]]\nname = 'soft'\ncloud = 'a'\nmaterial = { young = 1, poisson = "
      "0.3, density = 1 }\n[[obstacle]]\nname = 'ball'\nshape = 'sphere'\nradius = 1\ndensity = "
      "9\n[[obstacle]]\nname = 'wall'\nshape = 'plane'\n";
  EXPECT_FALSE(body_called("ball", scene, "scene.toml"));
  EXPECT_THAT(message_of([&] { body_called("wall", scene, "scene.toml"); }),
              HasSubstr("--follow wall: no body is called that; allowed: soft, ball"));
  FollowedBody ball("ball", scene, "scene.toml", RigidPaths(folder));
  FrameData frame;
  frame.point = {{7, 7, 7}};
  for (const double time : {0.0, 0.49}) {
    frame.time = time;
    ball.add(&frame, nullptr);
  }
  expect_near(ball.way(0), {0, 0, 0});
  expect_near(ball.way(1), {0, 0, 2});
  FollowedBody unknown("ball", scene, "scene.toml");
  EXPECT_THAT(message_of([&] { unknown.add(&frame, nullptr); }),
              HasSubstr("--follow ball: rigid.csv beside the frames lacks it"));
  std::filesystem::remove_all(folder);
}

TEST(OpeningView, IsThatOfTheScene) {
  std::vector<Instance> instances(2);
  instances[0].surfels = {{0, 0, 0}, {4, 4, 2}};
  instances[1].surfels = {{1, 0, 0}, {4, 3, 2}};
  const Extent extent = extent_of(instances);
  ASSERT_NEAR(extent.radius, 3, 1e-12);
  CameraWishes wishes;
  wishes.camera.position = Vec3d{2, -7, 1};
  wishes.camera.target = Vec3d{2, 2, 1};
  wishes.camera.field_of_view = 44;
  wishes.view = {0, 9, 0};
  auto page = opening_view(wishes, instances, extent, {});
  EXPECT_NEAR(page["view"]["distance"].get<double>(), 3, 1e-12);
  EXPECT_EQ(page["view"]["field_of_view"], 44);
  EXPECT_EQ(page["view"]["centred"], true);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(page["view"]["pivot"][k].get<double>(), 0, 1e-12);
  EXPECT_FALSE(page.contains("follow"));
  page = opening_view({}, instances, extent, {{0, 0, 0}, {0, 0, 3}});
  EXPECT_FALSE(page["view"].contains("distance"));
  EXPECT_EQ(page["view"]["centred"], false);
  EXPECT_NEAR(page["follow"][1][2].get<double>(), 1, 1e-12);
  double lowest = 0;
  for (const auto& p : page["outermost"]) lowest = std::min(lowest, p[2].get<double>());
  EXPECT_NEAR(lowest, (0 - 3 - 1) / 3.0, 1e-12);  // 3 m lower than where it is
}

/// A block that is thrown upwards, 40 mm in 0.02 s, in pictures of 0.4 m.
class FollowingPictures : public test::ThrownBlock {
 protected:
  /// Rows of the picture in which a column through the middle shows the block.
  std::pair<int, int> rows_of_block(const std::vector<std::string>& more, const char* name) const {
    std::vector<std::string> words{"render", "out",      "--frames",   "0,-1",
                                   "--out",  name,       "--no-floor", "--width",
                                   "200",    "--height", "200",        "--no-phyxels"};
    words.insert(words.end(), more.begin(), more.end());
    const auto done = run(words);
    EXPECT_EQ(done.code, 0) << done.err;
    const Image first = read_png(folder_ / name / "frame_000000.png"),
                last = read_png(folder_ / name / "frame_000002.png");
    const auto top = [](const Image& image) {
      int y = 0;
      while (y < image.height && image.pixel(100, y)[1] < image.pixel(100, y)[0] + 20) ++y;
      return y;
    };
    return {top(first), top(last)};
  }
};

TEST_F(FollowingPictures, KeepTheBodyInPlace) {
  throw_block(100);
  const std::vector<std::string> placed{"--position", "0,-6,0", "--target", "0,0,0"};
  const auto [still, higher] = rows_of_block(placed, "placed");
  EXPECT_GT(still, higher + 1);  // 40 mm are 2.7 px
  EXPECT_LT(higher, 100);
  std::vector<std::string> following = placed;
  following.insert(following.end(), {"--follow", "block"});
  const auto [before, after] = rows_of_block(following, "following");
  EXPECT_EQ(before, still);
  EXPECT_EQ(after, before);
  // The scene says it as well, and an option takes it back.
  write("scene.toml", test::text_of(folder_ / "scene.toml") +
                          "[render.camera]\nposition = [0, -6, 0]\ntarget = [0, 0, 0]\n"
                          "follow = 'block'\n");
  ASSERT_EQ(run({"run", "scene.toml", "--force"}).code, 0);
  EXPECT_EQ(rows_of_block({}, "scene"), std::pair(still, still));
  EXPECT_EQ(rows_of_block({"--follow", ""}, "back"), std::pair(still, higher));
  const auto refused = run({"render", "out", "--follow", "cow", "--out", "none"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--follow cow: no body is called that; allowed: block"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "none"));
}

}  // namespace
}  // namespace phyxel::app
