/// The data of a live page, and the surface that its shaders make of them.
#include "view/live_picture.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <string>

#include "phyxel/scene.hpp"
#include "view/live_scene.hpp"

namespace phyxel::app {
namespace {

/// A frame as a page decodes it.
struct Decoded {
  explicit Decoded(const std::string& message) {
    std::memcpy(&head, message.data(), sizeof head);
    numbers.resize(LivePicture::numbers_each * head.phyxels);
    std::memcpy(numbers.data(), message.data() + sizeof head,
                numbers.size() * sizeof(std::int16_t));
    places.resize((message.size() - sizeof head - 2 * numbers.size()) / sizeof(float));
    std::memcpy(places.data(), message.data() + sizeof head + 2 * numbers.size(),
                places.size() * sizeof(float));
  }
  const std::int16_t* row(std::size_t i) const {
    return numbers.data() + LivePicture::numbers_each * i;
  }
  Vec3d displacement(std::size_t i) const {
    const auto part = [&](int axis) {
      return head.middle[axis] + head.half[axis] * row(i)[axis] / 32767.0;
    };
    return {part(0), part(1), part(2)};
  }
  Mat3d gradient(std::size_t i) const {
    Mat3d g;
    for (int e = 0; e < 9; ++e)
      g(e / 3, e % 3) = head.gradient * row(i)[4 + 4 * (e / 3) + e % 3] / 32767.0;
    return g;
  }
  double field(std::size_t i) const {
    return head.low + (head.high - head.low) * (row(i)[3] / 32767.0 + 1) / 2;
  }
  FrameHead head;
  std::vector<std::int16_t> numbers;
  std::vector<float> places;
};

/// The place of a surfel, as the page's shader finds it.
Vec3d skinned(const LivePicture& picture, const Decoded& frame, std::size_t s) {
  Vec3d at;
  for (std::size_t c = 0; c < Carriers::each; ++c) {
    const std::uint32_t i = picture.carriers().phyxel[Carriers::each * s + c];
    const double weight = picture.carriers().weight[Carriers::each * s + c] / 255.0;
    const Vec3d apart = picture.surfels()[s] - picture.phyxels()[i];
    at += weight * (picture.surfels()[s] + frame.displacement(i) + frame.gradient(i) * apart);
  }
  return at;
}

/// Two jelly blocks that touch, of which the upper one presses on the lower, on a turning ball.
constexpr const char* scene =
    "gravity = [0, 0, -10]\n[time]\nend = 1\n[solver]\ndevice = 'cpu'\nthreads = 1\n[contact]\n"
    "[[body]]\nshape = 'block'\nsize = [0.2, 0.2, 0.1]\nspacing = 0.02\n[body.material]\n"
    "young = 2e4\npoisson = 0.3\ndensity = 1000\n[[body.fixed]]\nregion = 'z-'\n"
    "[[body]]\nname = 'upper'\nshape = 'block'\nsize = [0.2, 0.2, 0.1]\nspacing = 0.02\n"
    "translation = [0.05, 0, 0.1]\n[body.material]\nyoung = 2e4\npoisson = 0.3\ndensity = 1000\n"
    "[[obstacle]]\nname = 'ball'\nshape = 'sphere'\nradius = 0.1\ntranslation = [0, 0, 0.5]\n"
    "[obstacle.motion]\nvelocity = [0.1, 0, 0]\n";

TEST(LivePicture, CarriesTheSurfaceAsTheSolverDoes) {
  LiveScene live(parse_scene(scene, "scene.toml"), {}, false);
  const LivePicture picture(live);
  ASSERT_EQ(picture.phyxels().size(), static_cast<std::size_t>(live.model().global_count()));
  ASSERT_EQ(picture.surfels().size(), live.model().surfels.position.size());
  live.advance(400);
  SurfelState surfels;
  live.backend().advect_surfels(surfels);
  const Decoded frame(*picture.frame(live, -1, 1));
  double moved = 0, off = 0;
  for (std::size_t s = 0; s < surfels.position.size(); ++s) {
    moved = std::max(moved, norm(surfels.position[s] - picture.surfels()[s]));
    off = std::max(off, norm(surfels.position[s] - skinned(picture, frame, s)));
  }
  EXPECT_GT(moved, 0.5 * 0.02);
  // The nearest carriers instead of all within the support: a tenth of the distance between
  // phyxels.
  EXPECT_LT(off, 0.1 * 0.02);
  EXPECT_EQ(frame.head.time, live.solver().time());
}

TEST(LivePicture, HasDisplacementsFieldsAndObstacles) {
  LiveScene live(parse_scene(scene, "scene.toml"), {}, false);
  const LivePicture picture(live);
  live.advance(400);
  const State state = live.solver().state();
  ASSERT_EQ(picture.fields()[1].name, "speed");
  const Decoded frame(*picture.frame(live, 1, 7));
  EXPECT_EQ(frame.head.number, 7u);
  EXPECT_EQ(frame.head.field, 1);
  for (std::size_t i = 0; i < picture.ids().size(); ++i) {
    // Half a step of 16 bits of the ranges.
    EXPECT_LT(norm(frame.displacement(i) - state.displacement[picture.ids()[i]]),
              norm(Vec3d{frame.head.half[0], frame.head.half[1], frame.head.half[2]}) / 32767);
    EXPECT_NEAR(frame.field(i), norm(state.velocity[picture.ids()[i]]),
                (frame.head.high - frame.head.low) / 65534 * 1.01);
  }
  ASSERT_EQ(frame.places.size(), 12u);
  EXPECT_NEAR(frame.places[9], 0.1 * live.solver().time(), 1e-6);
  EXPECT_NEAR(frame.places[11], 0.5, 1e-6);
}

TEST(LivePicture, OfManyPhyxelsShowsSome) {
  LiveScene live(
      parse_scene("[time]\nend = 1\n[solver]\ndevice = 'cpu'\n[[body]]\nshape = 'block'\n"
                  "size = [1, 1, 1]\nspacing = 0.028\n[body.material]\nyoung = 1e5\n"
                  "poisson = 0.3\ndensity = 1000\n",
                  "scene.toml"),
      {}, false);
  ASSERT_GT(live.model().global_count(), static_cast<Index>(LivePicture::most_phyxels));
  const LivePicture picture(live);
  EXPECT_LT(picture.ids().size(), static_cast<std::size_t>(live.model().global_count()));
  EXPECT_TRUE(std::is_sorted(picture.ids().begin(), picture.ids().end()));
  live.advance(1);
  const Decoded frame(*picture.frame(live, 0, 1));
  EXPECT_EQ(frame.head.phyxels, picture.ids().size());
  for (std::size_t s = 0; s < picture.surfels().size(); s += 97) {
    EXPECT_LT(norm(skinned(picture, frame, s) - picture.surfels()[s]), 1e-9);  // it rests
  }
}

}  // namespace
}  // namespace phyxel::app
