/// The one check, and the defaults, of scenes from files and from code.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "phyxel/model.hpp"
#include "scene/scene_parameters.hpp"
#include "scene/scene_schema.hpp"
#include "support/clouds.hpp"
#include "support/refusal.hpp"
#include "support/scene_text.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

std::string refusal_of(const Scene& scene) {
  const Cloud cloud = testing::lattice(3, 3, 3, 0.1);
  return testing::refusal_of(
      [&] { build_model(scene, std::vector<Cloud>(scene.bodies.size(), cloud)); });
}

TEST(Validate, RefusesInCodeWhatScenesRefuse) {
  const auto with = [](auto&& change) {
    Scene scene = testing::one_body();
    change(scene.bodies[0]);
    return refusal_of(scene);
  };
  EXPECT_EQ(with([](BodyRequest&) {}), "accepted");
  EXPECT_EQ(with([](BodyRequest& b) { b.material.young = 0; }),
            "test.toml:1:1: key body.material.young of body \"body\": 0 found; allowed: a number, "
            "1e-12 <= young <= 1e+18 [Pa]");
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity, -infinity, 1e300}) {
    EXPECT_THAT(with([&](BodyRequest& b) { b.material.young = bad; }), HasSubstr("body.material."));
    EXPECT_THAT(with([&](BodyRequest& b) { b.material.density = bad; }), HasSubstr("density"));
    EXPECT_THAT(with([&](BodyRequest& b) { b.material.damping = bad; }), HasSubstr("damping"));
    EXPECT_THAT(with([&](BodyRequest& b) { b.material.hourglass = bad; }), HasSubstr("hourglass"));
    EXPECT_THAT(with([&](BodyRequest& b) { b.velocity.z = bad; }), HasSubstr("body.velocity"));
    EXPECT_THAT(with([&](BodyRequest& b) { b.spin.x = bad; }), HasSubstr("body.spin"));
    EXPECT_THAT(with([&](BodyRequest& b) { b.rotation.x = bad; }), HasSubstr("body.rotation"));
    EXPECT_THAT(with([&](BodyRequest& b) {
                  b.motions.push_back({.select = {.all = true}, .velocity = {bad, 0, 0}});
                }),
                HasSubstr("body.motion.velocity"));
    EXPECT_THAT(with([&](BodyRequest& b) {
                  b.loads.push_back({.select = {.all = true}, .force = {bad, 0, 0}});
                }),
                HasSubstr("body.load.force"));
    Scene falls = testing::one_body();
    falls.gravity.y = bad;
    EXPECT_THAT(refusal_of(falls), HasSubstr("key gravity: "));
  }
  for (const double bad : {0.5, -1.0, 0.7, nan}) {
    EXPECT_THAT(with([&](BodyRequest& b) { b.material.poisson = bad; }),
                HasSubstr("-1 < poisson < 0.5"));
  }
  EXPECT_THAT(
      with([](BodyRequest& b) {
        Material soft = b.material;
        soft.young = -1;
        b.inclusions.push_back({.select = {.indices = std::vector<Index>{0}}, .material = soft});
      }),
      HasSubstr("body.inclusion.young"));
}

TEST(Validate, AsksForOneMemberOfEachSelection) {
  Scene scene = testing::one_body();
  scene.bodies[0].fixed.push_back({.select = {.all = true, .where = "code:3"}});
  EXPECT_EQ(refusal_of(scene), "accepted");
  scene.bodies[0].fixed[0].select.box = Selection::Box{{0, 0, 0}, {1, 1, 1}};
  EXPECT_EQ(
      refusal_of(scene),
      "code:3: a selection of body \"body\" has 2 of region, indices, box, ball, mesh and all; "
      "allowed: exactly one");
  scene.bodies[0].fixed[0].select = {};
  EXPECT_THAT(refusal_of(scene), HasSubstr("has 0 of region"));
  scene.bodies[0].fixed[0].select = {.indices = std::vector<Index>{27}};
  EXPECT_THAT(refusal_of(scene), HasSubstr("phyxel 27 is not in body \"body\": allowed 0 to 26"));
}

TEST(Validate, AsksForABody) {
  EXPECT_EQ(refusal_of(Scene{}), "the scene has no bodies; needed: at least one");
  EXPECT_THROW(build_model(Scene{}), InputError);
}

TEST(Validate, AsksForCloudsThatCarryThePhysics) {
  const Scene scene = testing::one_body();
  const auto with = [&](auto&& change) -> std::string {
    Cloud cloud = testing::lattice(3, 3, 3, 0.1);
    change(cloud);
    try {
      testing::model_of(scene, cloud);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(with([](Cloud& c) { c.position[5].y = std::nan(""); }),
              HasSubstr("phyxel 5 of body \"body\" lies at"));
  EXPECT_THAT(with([](Cloud& c) { c.position[5].y = 1e13; }), HasSubstr("allowed: coordinates"));
  EXPECT_THAT(with([](Cloud& c) { c.volume[7] = 0; }),
              HasSubstr("phyxel 7 of body \"body\" has a volume of 0 m^3 (is the body flat?)"));
  EXPECT_THAT(with([](Cloud& c) { c.volume[7] = INFINITY; }), HasSubstr("volume of inf"));
  EXPECT_THAT(with([](Cloud& c) { c.volume.pop_back(); }), HasSubstr("26 volumes for 27"));
  EXPECT_THAT(with([](Cloud& c) { c = {}; }), HasSubstr("has no phyxel"));
  EXPECT_THAT(with([](Cloud& c) {  // no volume, by the kernel
                c.volume.clear();
                c.position.assign(20, Vec3d{1, 1, 1});
              }),
              HasSubstr("phyxel 0 of body \"body\" has a mass of "));
}

/// No number of a scene file may be so large that it overflows in what follows from it.
TEST(Validate, EveryNumberOfASceneIsBounded) {
  for (const SceneKey& key : scene_keys()) {
    const bool number = key.type == KeyType::number || key.type == KeyType::number_or_word ||
                        key.type == KeyType::vector || key.type == KeyType::box ||
                        key.type == KeyType::curve;
    if (!number) continue;
    EXPECT_TRUE(std::isfinite(key.range.low) && std::isfinite(key.range.high))
        << key.section << '.' << key.name;
    EXPECT_FALSE(key.range.contains(std::nan("")));
  }
}

TEST(Validate, CodeAndScenesHaveOneDefaultOfHourglassControl) {
  const Cloud cloud = testing::lattice(3, 3, 3, 0.1);
  const auto strength = [&](auto&& change) {
    Scene scene = testing::one_body();
    scene.bodies[0].material.hourglass = std::nullopt;
    change(scene.bodies[0]);
    return testing::model_of(scene, cloud).parts[0].material.hourglass;
  };
  EXPECT_EQ(strength([](BodyRequest&) {}), 0.1);
  EXPECT_EQ(strength([](BodyRequest& b) { b.material.hourglass = 0; }), 0.0);
  EXPECT_EQ(strength([](BodyRequest& b) { b.source.shape.name = "dino"; }), 0.0);
  EXPECT_EQ(strength([](BodyRequest& b) { b.neighbourhood.max_neighbours = 20; }), 0.0);
  EXPECT_EQ(parse_scene(time_section + beam + material, "s.toml").bodies[0].material.hourglass,
            0.1);
  EXPECT_EQ(parse_scene(time_section + dino, "s.toml").bodies[0].material.hourglass, 0.0);
}

/// Bodies and inclusions that name no law have the usual one, the bodies of the paper that of the
/// paper, in code and in scene files; checks and comparisons of scenes know it by name.
TEST(Validate, CodeAndScenesHaveOneDefaultLaw) {
  const Cloud cloud = testing::lattice(3, 3, 3, 0.1);
  const std::string paper = StVenantKirchhoff<double>::name;
  const auto laws = [&](auto&& change) {
    Scene scene = testing::one_body();
    BodyRequest& body = scene.bodies[0];
    body.material.law.clear();
    body.inclusions.push_back(
        {.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}}}, .material = body.material});
    change(body);
    validate(scene);
    const std::vector<Parameter> known = scene_parameters(scene);
    std::vector<std::string> found;
    for (const Part& part : testing::model_of(scene, cloud).parts) {
      found.push_back(part.material.law);
      const auto is_law = [&](const Parameter& p) {
        return p.name.find(".law of body 1") != std::string::npos &&
               p.value == '"' + part.material.law + '"';
      };
      EXPECT_TRUE(std::any_of(known.begin(), known.end(), is_law)) << part.material.law;
    }
    return found;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(laws([](BodyRequest&) {}), (Names{usual_law, usual_law}));
  EXPECT_EQ(laws([](BodyRequest& b) { b.source.shape.name = "dino"; }), (Names{paper, paper}));
  EXPECT_EQ(laws([](BodyRequest& b) { b.material.law = "hencky"; }), (Names{"hencky", "hencky"}));
  EXPECT_EQ(laws([](BodyRequest& b) { b.inclusions[0].material.law = "corotated"; }),
            (Names{usual_law, "corotated"}));
  EXPECT_EQ(parse_scene(time_section + beam + material, "s.toml").bodies[0].material.law,
            usual_law);
  EXPECT_EQ(parse_scene(time_section + dino, "s.toml").bodies[0].material.law, paper);
  // A material alone, too.
  Material alone = testing::rubber();
  alone.law.clear();
  EXPECT_EQ(std::string(law_table()[chosen_law(alone).index].name), usual_law);
}

}  // namespace
}  // namespace phyxel
