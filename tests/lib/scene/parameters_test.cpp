/// Parameters and digests that checkpoints compare.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>

#include "phyxel/model.hpp"
#include "scene/scene_parameters.hpp"
#include "scene/scene_schema.hpp"
#include "support/clouds.hpp"
#include "support/every_key.hpp"
#include "support/scene_text.hpp"

namespace phyxel {
namespace {

using phyxel::testing::every_key;
using ::testing::HasSubstr;

/// The text with the value of one key changed, or of none.
std::string with_other(const std::string& wanted, int* changed = nullptr) {
  std::istringstream lines(every_key);
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t mark = line.find("# "), arrow = line.find(" => ");
    if (mark == std::string::npos) {
      text += line + '\n';
      continue;
    }
    const bool this_one = line.substr(mark + 2, arrow - mark - 2) == wanted;
    if (this_one && changed) ++*changed;
    text += (this_one ? line.substr(arrow + 4) : line.substr(0, mark)) + '\n';
  }
  return text;
}

class Parameters : public SceneFiles {
 protected:
  Parameters() {
    for (const char* file : {"a.obj", "b.obj", "a.h5", "b.h5"}) write(file);
  }
  std::vector<Parameter> of(const std::string& text) const {
    return scene_parameters(parse_scene(text, folder_ / "scene.toml"));
  }
};

/// A key that is new in the table fails here until it says what a resumed run makes of it.
TEST_F(Parameters, EveryKeyIsComparedByNameOrFreeForAReason) {
  // Keys that become something else.
  const std::map<std::string, std::string> known_as = {
      {"body.array.count", "bodies: 14 then, 15 now"},
      {"body.array.spacing",
       "body.translation of body 3 (\"second 2\"): [5, 0, 0] then, "
       "[6, 0, 0] now"},
      {"probe.body", "probe.point of body 6 (\"fourth\"), probe 1: nothing then"},
      {"probe.from", "[0, 1, 0] then, [0, 0, 1], "},
      {"probe.to", "[0, 1, 0] then, [0, 0, 0], [0, 1, 0], [0, 2, 0] now"},
      {"probe.points", "[0, 1, 0] then, [0, 0, 0], [0, 0.3333333333333333, 0], "}};
  const std::vector<Parameter> base = of(with_other(""));
  EXPECT_EQ(parameter_differences(base, base), "");
  int compared = 0, free = 0;
  for (const SceneKey& key : scene_keys()) {
    if (key.type == KeyType::table || key.type == KeyType::tables) continue;
    const std::string path = key.section.empty() ? key.name : key.section + "." + key.name;
    int changed = 0;
    const std::string text = with_other(path, &changed);
    ASSERT_EQ(changed, 1) << path << " is not changed by this test";
    const std::string differences = parameter_differences(base, of(text));
    if (const char* why = free_on_resume(key.section, key.name)) {
      EXPECT_EQ(differences, "") << path << ", " << why;
      ++free;
      continue;
    }
    const auto known = known_as.find(path);
    EXPECT_THAT(differences, HasSubstr(known == known_as.end() ? path : known->second));
    EXPECT_THAT(differences, HasSubstr(" then, ")) << path;
    ++compared;
  }
  EXPECT_EQ(free, 22);  // all of the table of free keys are keys
  EXPECT_GT(compared, 60);
}

TEST_F(Parameters, OfManyBodiesAreAFewNamesAndAHash) {
  Scene scene = parse_scene(time_section + dino, "scene.toml");
  scene.bodies.resize(5000, scene.bodies[0]);
  const std::vector<Parameter> base = scene_parameters(scene);
  EXPECT_LT(base.size(), 3000u);
  scene.bodies[4321].velocity.y = 1e-9;
  EXPECT_THAT(parameter_differences(base, scene_parameters(scene)),
              HasSubstr("bodies 65 to 5000: hash"));
  scene.bodies[63].velocity.y = 1e-9;
  EXPECT_THAT(parameter_differences(base, scene_parameters(scene)),
              HasSubstr("body.velocity of body 64"));
}

TEST_F(Parameters, NamesOfBodiesCannotBreakLines) {
  Scene scene = testing::one_body();
  scene.bodies[0].name = "a\tb\n\"c\"";
  for (const Parameter& p : scene_parameters(scene)) {
    EXPECT_EQ((p.name + p.value).find_first_of("\t\n"), std::string::npos) << p.name;
  }
}

/// Each of these alone makes another model, whose checkpoints fit no other.
TEST(ModelDigest, TellsModelsApartByEveryValueTheyHave) {
  const auto digest_with = [](auto&& change) {
    Scene scene = testing::one_body();
    BodyRequest& body = scene.bodies[0];
    body.motions.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}}},
                            .displacement = {1, 0, 0},
                            .rotation = {0, 0, 9},
                            .about = {0, 1, 0},
                            .duration = 1,
                            .velocity = {1, 0, 0},
                            .amplitude = {1, 0, 0},
                            .frequency = 1});
    body.loads.push_back({.select = {.all = true}, .force = {1, 0, 0}, .ramp = 1});
    change(body);
    return model_digest(testing::model_of(scene, testing::lattice(3, 3, 3, 0.1)));
  };
  using Body = BodyRequest;
  const std::map<std::string, std::uint64_t> digests = {
      {"nothing", digest_with([](Body&) {})},
      {"young", digest_with([](Body& b) { b.material.young *= 2; })},
      {"poisson", digest_with([](Body& b) { b.material.poisson = 0.2; })},
      {"density", digest_with([](Body& b) { b.material.density *= 2; })},
      {"small-strain", digest_with([](Body& b) { b.material.law = "small-strain"; })},
      {"neo-hookean", digest_with([](Body& b) { b.material.law = "neo-hookean"; })},
      {"corotated", digest_with([](Body& b) { b.material.law = "corotated"; })},
      {"volume", digest_with([](Body& b) { b.material.volume_stiffness = 1; })},
      {"damping", digest_with([](Body& b) { b.material.damping = 1; })},
      {"hourglass", digest_with([](Body& b) { b.material.hourglass = 0.3; })},
      {"factor", digest_with([](Body& b) { b.neighbourhood.factor = 1.9; })},
      {"nearest", digest_with([](Body& b) { b.neighbourhood.nearest = 11; })},
      {"pairs", digest_with([](Body& b) {
         b.neighbourhood.support = NeighbourhoodRule::Support::pairwise;
       })},
      {"radius", digest_with([](Body& b) { b.neighbourhood.radius = 0.2; })},
      {"most", digest_with([](Body& b) { b.neighbourhood.max_neighbours = 20; })},
      {"displacement", digest_with([](Body& b) { b.motions[0].displacement.y = 1; })},
      {"rotation", digest_with([](Body& b) { b.motions[0].rotation.y = 1; })},
      {"about", digest_with([](Body& b) { b.motions[0].about.z = 1; })},
      {"duration", digest_with([](Body& b) { b.motions[0].duration = 2; })},
      {"velocity", digest_with([](Body& b) { b.motions[0].velocity.z = 1; })},
      {"amplitude", digest_with([](Body& b) { b.motions[0].amplitude.y = 1; })},
      {"frequency", digest_with([](Body& b) { b.motions[0].frequency = 2; })},
      {"axes x", digest_with([](Body& b) { b.motions[0].axes.x = false; })},
      {"axes y", digest_with([](Body& b) { b.motions[0].axes.y = false; })},
      {"axes z", digest_with([](Body& b) { b.motions[0].axes.z = false; })},
      {"moved", digest_with([](Body& b) { b.motions[0].select = {.all = true}; })},
      {"force", digest_with([](Body& b) { b.loads[0].force.z = 1; })},
      {"density of force", digest_with([](Body& b) { b.loads[0].force_density.x = 1; })},
      {"ramp", digest_with([](Body& b) { b.loads[0].ramp = 2; })},
      {"curve", digest_with([](Body& b) {
         b.loads[0].ramp = 0;
         b.loads[0].curve = {{0, 0}, {1, 2}};
       })},
      {"time of curve", digest_with([](Body& b) {
         b.loads[0].ramp = 0;
         b.loads[0].curve = {{0.5, 0}, {1, 2}};
       })},
      {"loaded", digest_with([](Body& b) {
         b.loads[0].select = {.indices = std::vector<Index>{1, 2}};
       })}};
  std::map<std::uint64_t, std::string> names;
  for (const auto& [name, digest] : digests) {
    const auto [other, is_new] = names.emplace(digest, name);
    EXPECT_TRUE(is_new) << name << " and " << other->second << " have one digest";
  }
}

}  // namespace
}  // namespace phyxel
