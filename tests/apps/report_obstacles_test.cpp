/// The obstacles of the pages of phyxel report: which there are, and where.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/contact.hpp"
#include "obstacle_rays.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"
#include "report/replay_obstacles.hpp"
#include "support/mesh_content.hpp"
#include "support/page.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::between;
using test::data_of;
using test::embedded;
using test::Outcome;
using test::seen_by_browser;
using test::text_of;
using ::testing::Contains;
using ::testing::HasSubstr;

/// A point on the surface of an obstacle of a page, in its own coordinates.
Vec3d surface_point(const json& obstacle) {
  const auto length = [&](int k) { return obstacle["lengths"][k].get<double>(); };
  if (obstacle["shape"] == "plane") return {};
  if (obstacle["shape"] == "box") return {length(0) / 2, length(1) / 4, length(2) / 2};
  if (obstacle["shape"] == "sphere") return {0, 0, length(0)};
  return {length(0), 0, length(1) / 4};  // the side of a cylinder or a capsule
}

/// A point of an obstacle of a page, in its own coordinates, where it is in a frame.
Vec3d placed_in(const json& obstacle, std::size_t frame, Vec3d x) {
  const json& places = obstacle["places"];
  const json& at = places[std::min(frame, places.size() - 1)];
  const auto row = [&](std::size_t k) {
    return at[3 * k].get<double>() * x.x + at[3 * k + 1].get<double>() * x.y +
           at[3 * k + 2].get<double>() * x.z + at[9 + k].get<double>();
  };
  return {row(0), row(1), row(2)};
}

TEST(ReplayObstacles, ThoseOfAllExamplesAreInTheirPlaces) {
  app::Extent extent;
  for (auto [axis, low, high] : {std::tuple{0, -1.0, 2.0}, {1, -3.0, 1.0}, {2, 0.0, 5.0}}) {
    extent.box[axis].include(low);
    extent.box[axis].include(high);
  }
  extent.radius = 3.5;
  const double times[] = {0, 0.1, 0.7};
  int scenes = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(PHYXEL_SOURCE_DIR) / "examples")) {
    const fs::path file = entry.path() / "scene.toml";
    if (!fs::exists(file) || text_of(file).find("[[obstacle]]") == std::string::npos) continue;
    ++scenes;
    const Scene scene = read_scene(file);
    const auto drawn =
        app::drawn_obstacles(scene.text, file, [](const fs::path&) { return std::string(); });
    const json all = app::obstacles_json(drawn.obstacles, {}, times, extent);
    ASSERT_EQ(all.size(), scene.obstacles.size()) << file;
    for (std::size_t k = 0; k < all.size(); ++k) {
      EXPECT_EQ(all[k]["name"], scene.obstacles[k].name);
      EXPECT_EQ(all[k]["shape"], scene.obstacles[k].shape);
      EXPECT_EQ(all[k]["hollow"], scene.obstacles[k].hollow);
      for (std::size_t f = 0; f < std::size(times); ++f) {
        const Vec3d shown = placed_in(all[k], f, surface_point(all[k]));
        const Vec3d there = extent.radius * shown + extent.centre();
        // Rounding: eps times coordinates below 100 m, over a few operations.
        EXPECT_NEAR(app::placed(drawn.obstacles, {}, times[f])[k].distance(there), 0, 1e-12)
            << file << " " << all[k]["name"];
      }
    }
  }
  EXPECT_GE(scenes, 9);
}

class RigidPaths : public test::Folder {};

TEST_F(RigidPaths, PutFreeBodiesWhereTheyWereInTheNearestFrame) {
  const Scene scene = parse_scene(
      "[time]\nend = 1\n[[obstacle]]\nname = 'die'\nshape = 'box'\nsize = [0.2, 0.2, 0.4]\n"
      "density = 1\n[[body]]\nshape = 'block'\nsize = [1, 1, 1]\nspacing = 0.5\n"
      "translation = [9, 0, 0]\n[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n",
      "scene.toml");
  const std::vector<Obstacle> obstacles = obstacles_of(scene);
  write("rigid.csv",
        "step,time [s],obstacle,shape,place_x [m],place_y [m],place_z [m],rotation_x [rad],"
        "rotation_y [rad],rotation_z [rad]\n"
        "0,0,die,box,0,0,0,0,0,0\n"
        "9,1,die,box,1,2,3,0,1.5707963267948966,0\n");
  const app::RigidPaths paths(folder_);
  const auto distance = [&](double time, Vec3d x) {
    return app::placed(obstacles, paths, time)[0].distance(x);
  };
  EXPECT_NEAR(distance(0.4, {0, 0, 0.2}), 0, 1e-12);  // rounding
  // Turned by a right angle about y: its long edges are along x.
  EXPECT_NEAR(distance(0.6, {1.2, 2, 3}), 0, 1e-12);
  EXPECT_NEAR(distance(7, {1, 2, 3.1}), 0, 1e-12);
  EXPECT_NEAR(app::placed(obstacles, {}, 1)[0].distance({0, 0, 0.2}), 0, 1e-12);
}

/// Bodies of a scene without obstacles have a floor, which they never touch.
TEST(Floors, LieBelowBodies) {
  for (const Vec3d up : {Vec3d{0, 0, 1}, Vec3d{0, -2, 0}, Vec3d{1, 1, 1}}) {
    const Vec3d middle{3, 4, 5}, unit = normalised(up);
    const double lowest = dot(middle, unit) - 0.5;
    const std::vector<Obstacle> floor{app::floor_below(up, middle, lowest, 1)};
    const app::PlacedObstacle placed = app::placed(floor, {}, 0)[0];
    EXPECT_FALSE(placed.bounded);
    EXPECT_NEAR(placed.distance(middle), 0.5 + 0.05, 1e-12);
    EXPECT_NEAR(placed.distance(middle + unit), 1.5 + 0.05, 1e-12);
  }
  EXPECT_TRUE(app::looks_down({0, 1, -0.6}, {0, 0, 1}));
  EXPECT_FALSE(app::looks_down({0, 1, 0}, {0, 0, 1}));
  EXPECT_FALSE(app::looks_down({0, 1, -0.6}, {0, 0, -1}));
}

class PagesWithObstacles : public test::Program {
 protected:
  /// Runs a block above one obstacle of each shape, of which the box moves by 1 m/s along x.
  void run_block() const {
    write("cube.stl", test::binary_stl(test::unit_cube()));
    write("scene.toml", R"(gravity = [0, 0, -9.81]
[time]
end = 0.1
[solver]
device = "cpu"
[output]
directory = "out"
frames_per_second = 20
fields = ["displacement"]
[[obstacle]]
name = "floor"
shape = "plane"
[[obstacle]]
name = "ball"
shape = "sphere"
radius = 0.2
translation = [0, 1, 0.2]
[[obstacle]]
name = "slide"
shape = "box"
size = [0.2, 0.2, 0.2]
translation = [1, 0, 0.1]
[obstacle.motion]
velocity = [1, 0, 0]
[[obstacle]]
name = "bin"
shape = "cylinder"
radius = 3
length = 4
hollow = true
[[obstacle]]
name = "pill"
shape = "capsule"
radius = 0.1
length = 0.3
translation = [-1, 0, 0.5]
[[obstacle]]
name = "stone"
shape = "mesh"
mesh = "cube.stl"
scale = 0.3
translation = [0, -1, 0]
[[body]]
shape = "block"
size = [0.4, 0.4, 0.4]
spacing = 0.1
translation = [0, 0, 0.5]
[body.material]
young = 1e5
poisson = 0.3
density = 1000
)");
    const Outcome done = run({"run", "scene.toml"});
    ASSERT_EQ(done.code, 0) << done.err;
  }
};

TEST_F(PagesWithObstacles, HaveAllShapesAndMovesThemWithTheFrames) {
  run_block();
  const Outcome done = run({"report", "out", "--json"});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_EQ(json::parse(done.out)["obstacles"],
            json({"floor", "ball", "slide", "bin", "pill", "stone"}));
  const std::string page = text_of(folder_ / "out" / "report.html");
  const json data = data_of(page), all = data["obstacles"];
  ASSERT_EQ(all.size(), 6u);
  const auto frames = data["frames"].size();
  ASSERT_EQ(frames, 3u);
  for (std::size_t k = 0; k < all.size(); ++k) {
    EXPECT_EQ(all[k]["places"].size(), k == 2 ? frames : 1u) << all[k]["name"];
  }
  // Lengths in units of the page: from the size of the box, which is 0.2 m.
  const double metre = all[2]["lengths"][0].get<double>() / 0.2;
  const double way = placed_in(all[2], 2, {}).x - placed_in(all[2], 0, {}).x;
  EXPECT_NEAR(way / metre, 0.1, 1e-12);  // 1 m/s for 0.1 s, to rounding
  const auto vertices = embedded<float>(page, "obstacle5");
  ASSERT_FALSE(vertices.empty());
  // The cube's corners are at 0 and 0.3 m, in float.
  EXPECT_NEAR(*std::ranges::max_element(vertices) / metre, 0.3, 1e-6);
  EXPECT_EQ(embedded<Triangle>(page, "obstacle5-triangles").size(), 12u);
}

TEST_F(PagesWithObstacles, SayWhichMeshIsGone) {
  run_block();
  fs::remove(folder_ / "cube.stl");
  const Outcome done = run({"report", "out", "--json"});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_EQ(json::parse(done.out)["obstacles"].size(), 5u);
  EXPECT_THAT(json::parse(done.out)["notes"].get<std::vector<std::string>>(),
              Contains(HasSubstr("obstacle \"stone\" is left out")));
}

TEST_F(PagesWithObstacles, ABrowserDrawsThem) {
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  run_block();
  ASSERT_EQ(run({"report", "out", "-o", "page.html"}).code, 0);
  const std::string seen = seen_by_browser(folder_, "page.html");
  EXPECT_THAT(seen, HasSubstr("data-state=\"drawn\""));
  EXPECT_THAT(seen, HasSubstr("data-error=\"0\""));
  EXPECT_THAT(seen, HasSubstr("data-obstacles=\"6\""));
  // Floor and bin take more than half of the stage, though they vanish far away; the block a tenth.
  EXPECT_GT(std::stod(between(seen, "data-drawn=\"", "\"")), 0.5);
}

}  // namespace
}  // namespace phyxel
