/// Pictures of a trajectory: content, choice of frames, and files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <random>

#include "annotation.hpp"
#include "ball.hpp"
#include "picture.hpp"
#include "png_file.hpp"
#include "png_reader.hpp"
#include "report/report.hpp"
#include "support/folder.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// --- whole pictures ----------------------------------------------------------------------------

Setting setting_for(const FrameData& surface, double spacing) {
  CameraFit fit(160, 120, {-1, 2, -0.6}, {0, 0, 1});
  fit.include(surface.point);
  Setting setting;
  setting.camera = fit.camera();
  setting.extent = fit.extent();
  setting.spacing = spacing;
  return setting;
}

int pixels_that_differ(const Image& a, const Image& b) {
  int count = 0;
  for (std::size_t k = 0; k < a.rgb.size(); k += 3) {
    count += !std::equal(&a.rgb[k], &a.rgb[k] + 3, &b.rgb[k]);
  }
  return count;
}

TEST(Picture, ShowsPhyxelsAsDotsOnTheSurfaceAndTheTimeBelow) {
  const FrameData surface = sphere({1, 2, 3}, 1, 30);
  FrameData phyxels;
  phyxels.point = {{1, 2, 3}, {1.5, 1.5, 3}, {0.5, 1.5, 3.5}};
  Setting setting = setting_for(surface, 0.5);
  const Image with = draw_picture(&surface, &phyxels, setting);
  const Image without = draw_picture(&surface, nullptr, setting);
  // Radius 0.2 spacings = 0.1 m; the sphere's 1 m is about 50 px: three dots of 80 px, one of them
  // maybe half hidden by another.
  EXPECT_GT(pixels_that_differ(with, without), 100);
  EXPECT_LT(pixels_that_differ(with, without), 400);
  EXPECT_EQ(with.rgb, draw_picture(&surface, &phyxels, setting).rgb);

  setting.time_decimals = -1;
  const Image unlabelled = draw_picture(&surface, &phyxels, setting);
  EXPECT_GT(pixels_that_differ(with, unlabelled), 30);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      if (x < 80 && y > 90) continue;  // the corner of the label
      ASSERT_TRUE(std::equal(with.pixel(x, y), with.pixel(x, y) + 3, unlabelled.pixel(x, y)));
    }
  }
}

TEST(Picture, LeavesOutDotsThatWouldHideTheSurface) {
  const FrameData surface = sphere({0, 0, 0}, 1, 30);
  FrameData phyxels;
  phyxels.point = {{0, 0, 0}, {0.5, -0.5, 0}};
  // The sphere's 1 m is about 50 px.
  const auto dots = [&](double spacing, double nearest) {
    Setting setting = setting_for(surface, spacing);
    setting.nearest_dots = nearest;
    return pixels_that_differ(draw_picture(&surface, &phyxels, setting),
                              draw_picture(&surface, nullptr, setting));
  };
  EXPECT_GT(dots(0.25, 8), 0);
  EXPECT_EQ(dots(0.1, 8), 0);
  EXPECT_GT(dots(0.1, 0), 0);
}

TEST(Picture, HasABarOfARoundLength) {
  const FrameData ball = sphere({1, 2, 3}, 0.01, 30);
  Setting setting = setting_for(ball, 0.001);
  setting.middle = {1, 2, 3};
  const double length = round_length(setting.camera, setting.middle);
  // The ball, 20 mm wide, takes 0.86 of 120 of 160 px: a fifth of the picture's width is 6 mm.
  EXPECT_NEAR(length, 0.005, 1e-12);
  const Image without = draw_picture(&ball, nullptr, setting);
  setting.scale_bar = true;
  const Image with = draw_picture(&ball, nullptr, setting);
  int longest = 0;
  for (int y = 60; y < 120; ++y) {
    int dark = 0;
    for (int x = 0; x < 160; ++x) dark += with.pixel(x, y)[0] == 64 && without.pixel(x, y)[0] > 64;
    longest = std::max(longest, dark);
  }
  const Camera& camera = setting.camera;
  const Vec3d end = setting.middle + length * camera.right;
  EXPECT_NEAR(longest, camera.project(end).x - camera.project(setting.middle).x, 1);
  EXPECT_EQ(round_length(camera, camera.eye - camera.forward), 0);
  for (int k = 0; k < 60; ++k) {  // every size
    setting.camera.focal *= 1.1;
    const double other = round_length(setting.camera, setting.middle);
    const double share =
        other * setting.camera.focal / setting.camera.project(setting.middle).depth / 160;
    EXPECT_GE(share, 0.08 - 1e-9);
    EXPECT_LE(share, 0.2 + 1e-9);
  }
}

/// A frame with a valid digest may have any normals; its picture is drawn.
TEST(Picture, NormalsAndSpacingsThatAreNotFiniteAreDrawn) {
  FrameData ball = sphere({0, 0, 0}, 1, 16), dots;
  const double infinity = std::numeric_limits<double>::infinity();
  const Vec3d odd[] = {{infinity, 0, 0}, {std::nan(""), 0, 1}, {1e300, -1e300, 0}, {0, 0, 0}};
  for (std::size_t s = 0; s < ball.normal.size(); ++s) ball.normal[s] = odd[s % std::size(odd)];
  dots.point = {{0, 0, 0}, {0.1, 0, 0}};
  Setting setting;
  CameraFit fit(64, 48, {0, 1, 0}, {0, 0, 1});
  fit.include(ball.point);
  setting.camera = fit.camera();
  for (const double spacing : {0.1, infinity, std::nan("")}) {
    setting.spacing = spacing;
    setting.extent = std::isnan(spacing) ? infinity : fit.extent();
    const Image image = draw_picture(&ball, &dots, setting);
    EXPECT_EQ(image.rgb.size(), 3u * 64 * 48);
    draw_picture(nullptr, &dots, setting);
  }
}

TEST(Picture, NormalsThatTheFrameLacksAreMade) {
  FrameData given = sphere({0, 0, 0}, 1, 60), lacking = given;
  lacking.normal.clear();
  const Setting setting = setting_for(given, 0.1);
  const Image a = draw_picture(&given, nullptr, setting);
  const Image b = draw_picture(&lacking, nullptr, setting);
  // Area-weighted normals of a fine sphere are within a degree or so of the true ones.
  for (std::size_t k = 0; k < a.rgb.size(); ++k) ASSERT_NEAR(a.rgb[k], b.rgb[k], 6) << k;
}

TEST(Picture, BodiesHaveTheirOwnColours) {
  FrameData both = sphere({-1.5, 0, 0}, 1, 20);
  const FrameData second = sphere({1.5, 0, 0}, 1, 20);
  const auto n = static_cast<Index>(both.point.size());
  both.body.assign(both.point.size(), 0);
  both.body.insert(both.body.end(), second.point.size(), 1);
  both.point.insert(both.point.end(), second.point.begin(), second.point.end());
  both.normal.insert(both.normal.end(), second.normal.begin(), second.normal.end());
  for (const auto& [a, b, c] : second.triangle) both.triangle.push_back({a + n, b + n, c + n});
  Setting setting = setting_for(both, 0.1);
  const Image image = draw_picture(&both, nullptr, setting);
  const auto pixel_at = [&](Vec3d point) {
    const Camera::Place place = setting.camera.project(point);
    return image.pixel(static_cast<int>(place.x), static_cast<int>(place.y));
  };
  const std::uint8_t *green = pixel_at({-1.5, 0, 0}), *violet = pixel_at({1.5, 0, 0});
  EXPECT_GT(green[1], 20 + std::max(green[0], green[2]));
  EXPECT_LT(violet[1], std::min(violet[0], violet[2]) - 20);
}

// --- files -------------------------------------------------------------------------------------

class Files : public test::Folder {
 protected:
  std::vector<std::string> names_in(const fs::path& folder) const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder)) {
      names.push_back(entry.path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }
};

TEST_F(Files, APngHoldsExactlyThePixels) {
  for (const auto& [width, height] : {std::pair{1, 1}, {17, 5}, {300, 200}}) {
    Image image{width, height, {}};
    std::mt19937 random(1);
    for (int k = 0; k < 3 * width * height; ++k) {
      image.rgb.push_back(static_cast<std::uint8_t>(random() >> 24));
    }
    write_png(folder_ / "a.png", image);  // the second and third replace the one before
    const Image back = read_png(folder_ / "a.png");
    EXPECT_EQ(back.width, width);
    EXPECT_EQ(back.height, height);
    EXPECT_EQ(back.rgb, image.rgb);
    EXPECT_THAT(names_in(folder_), ElementsAre("a.png"));
  }
}

TEST_F(Files, AFolderThatCannotTakeAPngIsNamed) {
  const Image image{1, 1, {0, 0, 0}};
  EXPECT_THROW(write_png(folder_ / "absent" / "a.png", image), OutputError);
  EXPECT_THAT(message_of([&] { write_png(folder_ / "absent" / "a.png", image); }),
              HasSubstr("absent/a.png"));
  EXPECT_THAT(names_in(folder_), IsEmpty());
}

TEST(ChooseFrames, FollowsTheTable) {
  const struct {
    FrameChoice choice;
    std::size_t available;
    std::vector<std::size_t> expected;
  } table[] = {
      {{}, 4, {0, 1, 2, 3}},
      {{}, 0, {}},
      {{.frames = {2, 0, 2}}, 4, {0, 2}},
      {{.frames = {-1, 0}}, 4, {0, 3}},
      {{.frames = {-4}}, 4, {0}},
      {{.count = 1}, 4, {3}},
      {{.count = 2}, 51, {0, 50}},
      {{.count = 6}, 51, {0, 10, 20, 30, 40, 50}},
      {{.count = 3}, 4, {0, 2, 3}},  // 1.5 rounds up
      {{.count = 9}, 4, {0, 1, 2, 3}},
      {{.count = 3}, 1, {0}},
      {{.every = 2}, 4, {0, 2}},
      {{.every = 3}, 4, {0, 3}},
      {{.every = 100}, 4, {0}},
  };
  for (const auto& row : table) EXPECT_EQ(choose_frames(row.choice, row.available), row.expected);
}

TEST(ChooseFrames, FramesThatAreNotThereAreNamed) {
  EXPECT_EQ(message_of([] {
              choose_frames({.frames = {1, 4}}, 4);
            }),
            "frame 4: there are 4; allowed: -4 to 3");
  EXPECT_THROW(choose_frames({.frames = {-5}}, 4), InputError);
  EXPECT_THROW(choose_frames({.count = -1}, 4), InputError);
  EXPECT_THROW(choose_frames({.every = -2}, 4), InputError);
}

/// A trajectory of three frames: a ball that falls, with two phyxels inside.
class Trajectory : public Files {
 protected:
  Trajectory() {
    const FrameData ball = sphere({0, 0, 0}, 1, 16);
    model_.position = {{0.3, 0, 0}, {-0.3, 0, 0}};
    model_.mass = model_.volume = {1, 1};
    model_.surfels.position = ball.point;
    model_.surfels.normal = ball.normal;
    model_.surfels.triangle = ball.triangle;
    Part part;
    part.end = 2;
    part.surfel_end = static_cast<Index>(ball.point.size());
    model_.parts = {part};
    scene_.output.directory = run_ = folder_ / "run";
    scene_.time.end = 0.5;
    scene_.output.frames_per_second = 4;
    ball_ = ball;
    record("");
    request_.width = 160;
    request_.height = 120;
  }
  /// Writes the trajectory, with the text of a scene in its frames.
  void record(const std::string& scene_text) {
    scene_.text = scene_text;
    const FrameData& ball = ball_;
    Recorder recorder(model_, scene_, false);
    for (int k = 0; k < 3; ++k) {
      const Vec3d fall{0, 0, -2.0 * k};
      State state;
      state.displacement = {fall, fall};
      state.velocity.resize(2);
      state.time = 0.25 * k;
      state.step = k;
      SurfelState surfels{ball.point, ball.normal};
      for (Vec3d& p : surfels.position) p += fall;
      Frame frame;
      frame.state = &state;
      frame.surfels = &surfels;
      frame.diagnostics.time = state.time;
      frame.diagnostics.step = k;
      recorder.write(frame);
    }
  }
  FrameData ball_;
  Model model_;
  Scene scene_;
  fs::path run_;
  PictureRequest request_;
};

/// Mean height of the green surface on the picture [px, downwards].
double height_of_body(const Image& image) {
  double sum = 0, count = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const std::uint8_t* p = image.pixel(x, y);
      if (p[1] < p[0] + 20) continue;
      sum += y;
      ++count;
    }
  }
  EXPECT_GT(count, 100);
  return sum / count;
}

/// Positions, camera and depths are in double, so that a body looks the same at any position.
TEST_F(Trajectory, PicturesFarFromTheOriginShowTheBodyAsNearIt) {
  render(run_, folder_ / "near", request_, false);
  const Vec3d far{1e7, -1e7, 1e7};
  for (auto* points : {&ball_.point, &model_.position, &model_.surfels.position}) {
    for (Vec3d& p : *points) p += far;
  }
  model_.parts[0].farthest = 1e7;
  model_.parts[0].surfels = model_.parts[0].surfel_end;
  fs::remove_all(run_);
  record("");
  render(run_, folder_ / "far", request_, false);
  for (const char* name : {"frame_000000.png", "frame_000002.png"}) {
    const Image near = read_png(folder_ / "near" / name), there = read_png(folder_ / "far" / name);
    EXPECT_NEAR(height_of_body(near), height_of_body(there), 0.1) << name;
    // Coordinates are 2 nm apart there: some pixels at edges may fall to the other side.
    EXPECT_LT(pixels_that_differ(near, there), near.width * near.height / 100) << name;
  }
}

/// The scene in a frame sets the directions of pictures; options override it.
TEST_F(Trajectory, PicturesAreUpAsTheirSceneSays) {
  const auto drop = [&](const std::string& keys) {
    fs::remove_all(run_);
    record(keys + R"(
[time]
end = 1
[[body]]
cloud = "ball"
material = { young = 1e5, poisson = 0.3, density = 1000 }
)");
    render(run_, folder_ / "p", request_, true);
    return height_of_body(read_png(folder_ / "p" / "frame_000002.png")) -
           height_of_body(read_png(folder_ / "p" / "frame_000000.png"));
  };
  // The ball moves towards -z: down where nothing is said, up where gravity is or the scene says
  // so.
  EXPECT_GT(drop(""), 20);
  EXPECT_GT(drop("gravity = [0, 0, -9.81]"), 20);
  EXPECT_LT(drop("gravity = [0, 0, 9.81]"), -20);
  EXPECT_LT(drop("gravity = [0, 0, -9.81]\n[render]\nup = [0, 0, -1]"), -20);
  EXPECT_NEAR(drop("[render]\nup = [0, 1, 0]\nview = [-1, 0, 0]"), 0, 3);  // sideways
  request_.camera.up = Vec3d{0, 0, 1};
  request_.camera.view = Vec3d{0, 1, 0};
  EXPECT_GT(drop("gravity = [0, 0, 9.81]"), 20);
}

/// The author of a frame cannot make a report take unlimited time or memory.
TEST_F(Trajectory, ReportsBuildNoMoreThanTheFramesHold) {
  const auto note = [&](const std::string& body) {
    fs::remove_all(run_);
    const std::string text = "[time]\nend = 1\n" + body +
                             "\n[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n";
    record(text);
    const Report report = replay_page({.input = run_});
    return report.notes.empty() ? "" : report.notes.front();
  };
  EXPECT_THAT(note("[[body]]\nshape = \"block\"\nsize = [1, 1, 1]\nphyxels = 20000000"),
              HasSubstr("it asks for about 2e+07 phyxels, the frames have 2"));
  EXPECT_THAT(note("[[body]]\nshape = \"block\"\nsize = [1, 1, 1]\nspacing = 1e-5"),
              HasSubstr("it asks for about 1e+15 phyxels"));
  EXPECT_THAT(note("[[body]]\nshape = \"dino\"\n[body.array]\ncount = [100, 10, 10]\n"
                   "spacing = [1, 1, 1]"),
              HasSubstr("it asks for about"));
  const fs::path mesh = write("outside.obj",
                              "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
                              "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  EXPECT_THAT(note("[[body]]\nmesh = \"" + mesh.string() + "\"\nphyxels = 2"),
              HasSubstr("outside the run's folder"));
}

/// A run that was killed between the two frames of one time, or a folder assembled by hand.
TEST_F(Trajectory, ReportsLeaveOutFramesWithoutOneOfTheirFamilies) {
  const fs::path series = run_ / "phyxels.hdf.series";
  std::string text = test::text_of(series);
  const std::size_t last = text.rfind(",\n{");
  ASSERT_NE(last, std::string::npos);
  text.replace(last, text.find(']', last) - last, "\n");
  std::ofstream(series) << text;
  const Report report = replay_page({.input = run_});
  EXPECT_EQ(report.frames, 2u);
  EXPECT_THAT(report.notes, ::testing::Contains(HasSubstr("1 frames are left out")));
}

TEST_F(Trajectory, OneCameraSeesTheWholeMotion) {
  const auto files = render(run_, folder_ / "pictures", request_, false);
  EXPECT_THAT(names_in(folder_ / "pictures"),
              ElementsAre("frame_000000.png", "frame_000001.png", "frame_000002.png"));
  ASSERT_EQ(files.size(), 3u);
  std::vector<double> height;
  for (const fs::path& file : files) height.push_back(height_of_body(read_png(file)));
  // The ball starts at the top, ends at the bottom, and is half way in between: perspective and
  // the dots, which are not green, move the middle by a few pixels.
  EXPECT_LT(height[0], 40);
  EXPECT_GT(height[2], 80);
  EXPECT_NEAR(height[1], 0.5 * (height[0] + height[2]), 4);
}

TEST_F(Trajectory, PicturesThatExistAreKeptUnlessForced) {
  const fs::path pictures = folder_ / "pictures";
  fs::create_directory(pictures);
  std::ofstream(pictures / "frame_000002.png") << "mine";
  EXPECT_THAT(message_of([&] { render(run_, pictures, request_, false); }),
              HasSubstr("frame_000002.png: exists already and is kept"));
  EXPECT_THAT(names_in(pictures), ElementsAre("frame_000002.png"));
  EXPECT_EQ(fs::file_size(pictures / "frame_000002.png"), 4u);
  request_.choice.frames = {0, 1};
  EXPECT_EQ(render(run_, pictures, request_, false).size(), 2u);  // not in the way
  request_.choice = {};
  EXPECT_EQ(render(run_, pictures, request_, true).size(), 3u);
  EXPECT_EQ(read_png(pictures / "frame_000002.png").width, 160);
}

TEST_F(Trajectory, AFrameAndASeriesCanBeDrawnAlone) {
  EXPECT_EQ(render(run_ / "surface_000001.hdf", folder_ / "one", request_, false),
            std::vector{folder_ / "one" / "surface_000001.png"});
  EXPECT_EQ(render(run_ / "phyxels.hdf.series", folder_ / "series", request_, false).size(), 3u);
  height_of_body(read_png(folder_ / "series" / "frame_000000.png"));  // balls in the body's colour
}

TEST_F(Trajectory, ARunDrawsItsFolderAndRemovesStalePictures) {
  fs::create_directories(run_ / "pictures");
  for (const char* name : {"frame_000007.png", "notes.txt", "frame_a.png"}) {
    std::ofstream(run_ / "pictures" / name) << "old";
  }
  Scene scene;
  scene.render.count = 2;
  scene.render.width = scene.render.height = 64;
  EXPECT_EQ(render_directory(run_, scene, true).size(), 2u);
  EXPECT_THAT(names_in(run_ / "pictures"),
              ElementsAre("frame_000000.png", "frame_000002.png", "frame_a.png", "notes.txt"));
}

TEST_F(Trajectory, WrongInputIsNamedAndLeavesNothing) {
  const fs::path out = folder_ / "pictures";
  const auto refused = [&](const fs::path& input, const PictureRequest& request) {
    return message_of([&] { render(input, out, request, false); });
  };
  EXPECT_THAT(refused(folder_ / "absent", request_), HasSubstr("absent: no such file or folder"));
  EXPECT_THAT(refused(folder_, request_), HasSubstr("has no trajectory"));
  PictureRequest late = request_, flat = request_, balls = request_;
  late.choice.frames = {3};
  flat.width = 0;
  balls.surface = false;
  EXPECT_THAT(refused(run_, late), HasSubstr("frame 3: there are 3"));
  EXPECT_THAT(refused(run_, flat), HasSubstr("0 x 120 pixels"));
  EXPECT_THAT(refused(run_ / "surface.hdf.series", balls), HasSubstr("holds a surface only"));
  std::ofstream(folder_ / "foreign.hdf") << "not a frame";
  EXPECT_THAT(refused(folder_ / "foreign.hdf", request_), HasSubstr("foreign.hdf"));
  fs::remove(run_ / "surface_000001.hdf");
  EXPECT_THAT(refused(run_, request_), HasSubstr("surface_000001.hdf"));
  EXPECT_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace phyxel::app
