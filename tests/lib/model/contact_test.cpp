/// What obstacles need of the bodies that are to touch them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "phyxel/error.hpp"
#include "phyxel/model.hpp"
#include "support/scene_text.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

const std::string end = time_section;
std::string obstacle(const std::string& keys) { return "[[obstacle]]\n" + keys; }

/// A block of 5 x 5 x 5 phyxels on its faces, 0.2 m wide.
std::string block(const std::string& more = "") {
  return "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\n"
         "lattice = 'nodes'\n" +
         more + material;
}

std::string refusal_of(const std::string& text) {
  try {
    build_model(parse_scene(text, "scene.toml"));
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ContactLayer, IsRefusedToBodiesThatOverlapAnObstacleAtTheStart) {
  const std::string message = refusal_of(
      end + obstacle("name = 'floor'\nshape = 'plane'\ntranslation = [0, 0, -0.07]\n") + block());
  EXPECT_THAT(message, HasSubstr("body \"block\" is 0.03 m deep in obstacle \"floor\""));
  EXPECT_THAT(message, HasSubstr("allowed: to touch it, or to begin outside"));
  EXPECT_THAT(
      refusal_of(end + obstacle("shape = 'sphere'\nradius = 0.15\nhollow = true\n") + block()),
      HasSubstr("to begin inside, as it is hollow"));
}

TEST(ContactLayer, IsRefusedWithObstaclesInsideBodies) {
  EXPECT_THAT(refusal_of(end + obstacle("shape = 'sphere'\nradius = 0.06\n") + block()),
              HasSubstr("is 0.06 m deep in obstacle \"obstacle 1\""));
}

TEST(ContactLayer, IsWarnedOfThinObstacles) {
  const Model model = build_model(parse_scene(
      end + obstacle("shape = 'capsule'\nradius = 0.01\nlength = 1\ntranslation = [0, 0, -3]\n") +
          block(),
      "scene.toml"));
  ASSERT_EQ(model.warnings.size(), 1u);
  EXPECT_THAT(model.warnings[0],
              HasSubstr("\"obstacle 1\" is 0.02 m thick, less than two supports"));
}

TEST(ContactLayer, IsRefusedToASinglePhyxel) {
  EXPECT_THAT(
      refusal_of(end + obstacle("shape = 'plane'\ntranslation = [0, 0, -1]\n") +
                 "[[body]]\nname = 'dot'\nshape = 'block'\nsize = [0.02, 0.02, 0.02]\n"
                 "spacing = 0.02\nlattice = 'cells'\n[body.material]\nyoung = 1e5\npoisson = 0.3\n"
                 "density = 1000\n"),
      HasSubstr("body \"dot\" has no phyxel within 0.75 spacings of its surface"));
}

TEST(ContactLayer, IsRefusedToBodiesWithoutSurfaces) {
  EXPECT_THAT(refusal_of(end + obstacle("shape = 'plane'\ntranslation = [0, 0, -0.1]\n") +
                         block("surfels = false\n")),
              HasSubstr("body \"block\" has no surface with which to touch"));
}

}  // namespace
}  // namespace phyxel
