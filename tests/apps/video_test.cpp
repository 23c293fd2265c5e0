/// Videos of a trajectory: what ffmpeg is told and given, files, and refusals. Most tests put a
/// program of their own in the place of ffmpeg.
#include "video.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <cstdlib>
#include <fstream>

#include "camera.hpp"
#include "support/skips.hpp"
#include "support/thrown_block.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;

constexpr std::size_t picture_bytes = 3u * 64 * 48;

class Videos : public test::ThrownBlock {
 protected:
  void SetUp() override {
    ThrownBlock::SetUp();
    throw_block(200);
  }
  /// Makes a script the only ffmpeg on PATH. Its last argument is file:NAME.
  void use_ffmpeg(const std::string& script) {
    fs::create_directories(folder_ / "bin");
    std::ofstream(folder_ / "bin" / "ffmpeg") << "#!/bin/sh\nfor last; do :; done\n" << script;
    fs::permissions(folder_ / "bin" / "ffmpeg", fs::perms::owner_all);
    environment_ = {{"PATH", (folder_ / "bin").string() + ":/usr/bin:/bin"}};
  }
  Outcome video(const std::string& file, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"render", "out", "--video", file};
    words.insert(words.end(), {"--width", "64", "--height", "48"});
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  }
  /// The names of a folder's entries that contain a text.
  std::size_t entries_with(const std::string& text) const {
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      count += entry.path().filename().string().find(text) != std::string::npos;
    }
    return count;
  }
};

constexpr const char* copying =
    "printf '%s\\n' \"$@\" >arguments.txt\n"
    "cat >\"${last#file:}\"\n";

TEST_F(Videos, GiveFfmpegEveryFrame) {
  use_ffmpeg(copying);
  const Outcome done = video("a b;c.mp4", {"--fps", "10"});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("a b;c.mp4: 5 pictures, 0.5 s"));
  const std::string frames = text_of(folder_ / "a b;c.mp4"),
                    arguments = text_of(folder_ / "arguments.txt");
  ASSERT_EQ(frames.size(), 5 * picture_bytes);
  EXPECT_NE(frames.substr(0, picture_bytes), frames.substr(4 * picture_bytes));  // it moves
  EXPECT_THAT(arguments, HasSubstr("rgb24\n-video_size\n64x48\n-framerate\n10\n"));
  EXPECT_THAT(arguments, HasSubstr("\n-f\nmp4\nfile:/"));
  EXPECT_EQ(entries_with(".tmp"), 0u);
  EXPECT_FALSE(fs::exists(folder_ / "out" / "pictures"));
}

TEST_F(Videos, TurnTheCameraAroundAFrame) {
  use_ffmpeg(copying);
  ASSERT_EQ(video("turn.webm", {"--frames", "0", "--fps", "2", "--orbit", "360"}).code, 0);
  const std::string frames = text_of(folder_ / "turn.webm");
  ASSERT_EQ(frames.size(), 8 * picture_bytes);  // four seconds
  const auto picture = [&](std::size_t k) {
    return frames.substr(k * picture_bytes, picture_bytes);
  };
  EXPECT_NE(picture(0), picture(1));
  // The eighth is the first, after a whole turn: equal but for rounding at edges.
  std::size_t different = 0;
  for (std::size_t k = 0; k < picture_bytes; ++k) different += picture(0)[k] != picture(7)[k];
  EXPECT_LT(different, picture_bytes / 50);
}

TEST_F(Videos, ThatFailAreToldAndLeaveNothing) {
  // It reads all and fails, fails at once, or writes nothing.
  for (const char* script :
       {"cat >\"${last#file:}\"\necho 'no such encoder' >&2\nexit 1\n",
        "echo 'no such encoder' >&2\nexit 1\n", "cat >/dev/null\necho 'no such encoder' >&2\n"}) {
    use_ffmpeg(script);
    const Outcome done = video("film.mp4");
    EXPECT_EQ(done.code, 74);
    EXPECT_THAT(done.err, HasSubstr("film.mp4: ffmpeg failed: no such encoder"));
    EXPECT_EQ(entries_with("film.mp4"), 0u);
  }
}

TEST_F(Videos, LeaveFilesAloneUnlessForced) {
  use_ffmpeg(copying);
  write("kept.mp4", "mine");
  EXPECT_THAT(video("kept.mp4").err, HasSubstr("kept.mp4: exists already and is kept"));
  EXPECT_EQ(text_of(folder_ / "kept.mp4"), "mine");
  EXPECT_EQ(mkfifo((folder_ / "pipe.mp4").c_str(), 0600), 0);
  for (const char* odd : {"pipe.mp4", "null.mp4", "lost.mp4"}) {
    if (std::string(odd) == "null.mp4") fs::create_symlink("/dev/null", folder_ / odd);
    if (std::string(odd) == "lost.mp4") fs::create_symlink("nowhere", folder_ / odd);
    const Outcome done = video(odd, {"--force"});
    EXPECT_EQ(done.code, 2) << odd;
    EXPECT_THAT(done.err, HasSubstr("allowed:")) << odd;
  }
  EXPECT_FALSE(fs::exists(folder_ / "arguments.txt"));  // ffmpeg was not started
  ASSERT_EQ(video("kept.mp4", {"--force"}).code, 0);
  EXPECT_EQ(text_of(folder_ / "kept.mp4").size(), 5 * picture_bytes);
  // A video that fails leaves the old one.
  use_ffmpeg("cat >\"${last#file:}\"\nexit 1\n");
  EXPECT_EQ(video("kept.mp4", {"--force"}).code, 74);
  EXPECT_EQ(text_of(folder_ / "kept.mp4").size(), 5 * picture_bytes);
}

TEST_F(Videos, WrongRequestsAreRefused) {
  use_ffmpeg(copying);
  const auto refused = [&](const Outcome& outcome, const char* why) {
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_EQ(entries_with("film"), 0u);
  };
  refused(video("film.avi"), "--video film.avi: allowed: a name that ends in .mp4");
  refused(video("film.mp4", {"--width", "65"}), "--width");
  refused(run({"render", "out", "--video", "film.mp4", "--width", "65"}),
          "--width 65 --height 720: allowed: even numbers");
  refused(video("film.mp4", {"--fps", "0"}), "--fps");
  refused(video("film.mp4", {"--orbit", "nan"}), "--orbit nan: allowed: a finite angle");
  refused(video("film.mp4", {"--out", "pictures"}), "--out");
  refused(run({"render", "out", "--fps", "5"}), "--video");
  environment_ = {{"PATH", (folder_ / "out").string()}};
  refused(video("film.mp4"),
          "--video film.mp4: ffmpeg, which encodes videos, is not on PATH (Debian: ffmpeg); "
          "allowed without it: a numbered sequence of pictures");
}

TEST_F(Videos, OfARealEncoderPlay) {
  PHYXEL_NEEDS_TOOL(std::system("command -v ffmpeg >/dev/null") == 0, "ffmpeg");
  for (const char* file : {"film.mp4", "film.gif", "film.webm"}) {
    const Outcome done = video(file, {"--fps", "10"});
    ASSERT_EQ(done.code, 0) << done.err;
    const std::string raw = (folder_ / "raw").string(), film = (folder_ / file).string();
    ASSERT_EQ(std::system(("ffmpeg -loglevel error -nostdin -y -i " + film +
                           " -fps_mode passthrough -f rawvideo -pix_fmt rgb24 " + raw)
                              .c_str()),
              0);
    EXPECT_EQ(fs::file_size(raw), 5 * picture_bytes) << file;
  }
}

TEST(Orbit, SeesAllPointsFromAllSides) {
  const std::vector<Vec3d> points{{-3, 0, 1}, {3, 0.5, 1}, {0, 0, 4}, {0, 0, -1}};
  app::CameraFit fit(160, 120, {0, 1, -0.5}, {0, 0, 1});
  fit.include(points);
  const auto cameras = app::orbit(fit.camera(), {0, 0, 1}, fit.middle(), points, 180, 19);
  ASSERT_EQ(cameras.size(), 19u);
  for (const app::Camera& camera : cameras) {
    for (const Vec3d& point : points) {
      const auto place = camera.project(point);
      EXPECT_GT(place.depth, 0);
      EXPECT_TRUE(place.x > 0 && place.x < 160 && place.y > 0 && place.y < 120);
    }
    EXPECT_NEAR(norm(camera.eye - fit.middle()), norm(cameras[0].eye - fit.middle()), 1e-9);
    EXPECT_NEAR(dot(camera.right, Vec3d{0, 0, 1}), 0, 1e-12);  // the horizon stays level
  }
  EXPECT_NEAR(norm(cameras[0].forward - fit.camera().forward), 0, 1e-12);
  EXPECT_NEAR(cameras[18].forward.y, -cameras[0].forward.y, 1e-12);
  EXPECT_NEAR(cameras[18].forward.z, cameras[0].forward.z, 1e-12);
}

}  // namespace
}  // namespace phyxel
