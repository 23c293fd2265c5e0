/// The documentation of scenes says what the reader does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "scene/scene_schema.hpp"
#include "support/scene_text.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

/// All that a scene says about numbers and words, for comparing two of them.
std::string digest(const Scene& s) {
  std::ostringstream text;
  text.precision(17);
  const auto vector = [&](Vec3d v) { text << v.x << ' ' << v.y << ' ' << v.z << '\n'; };
  vector(s.gravity);
  text << s.time.end << ' ' << s.time.step.value_or(-1) << ' ' << s.time.safety << '\n'
       << s.solver.device << ' ' << static_cast<int>(s.solver.precision) << ' ' << s.solver.threads
       << '\n'
       << s.output.directory << ' ' << s.output.frames_per_second << ' ' << s.output.phyxels << ' '
       << s.output.surface << ' ' << s.output.checkpoint_every << '\n';
  for (const std::string& field : s.output.fields) text << field << '\n';
  text << s.render.pictures << ' ' << s.render.count << ' ' << s.render.width << ' '
       << s.render.height << '\n';
  vector(s.render.view), vector(s.render.up);
  for (const BodyRequest& b : s.bodies) {
    text << b.name << ' ' << b.source.phyxels << ' ' << b.source.shape.jitter << ' '
         << b.source.seed << ' ' << b.source.relaxations << ' ' << b.source.shape.surface << ' '
         << b.scale << '\n';
    for (const Vec3d v : {b.rotation, b.translation, b.velocity, b.spin}) vector(v);
    text << static_cast<int>(b.volume_rule) << ' ' << b.closure.value_or(-1) << ' '
         << b.material.law << ' ' << b.material.volume_stiffness << ' ' << b.material.damping << ' '
         << b.material.hourglass.value_or(-1) << ' ' << static_cast<int>(b.neighbourhood.support)
         << ' ' << b.neighbourhood.nearest << ' ' << b.neighbourhood.factor << '\n';
    for (const MotionRequest& m : b.motions) {
      for (const Vec3d v : {m.displacement, m.velocity, m.amplitude}) vector(v);
    }
    for (const LoadRequest& l : b.loads) {
      vector(l.force), vector(l.force_density);
      text << l.ramp << ' ' << l.curve.size() << '\n';
    }
  }
  return text.str();
}

/// "name = fallback" for each key of a section that has a default and is not in `skip`.
std::string defaults_of(const std::string& section, const std::vector<std::string>& skip = {}) {
  std::string text;
  for (const SceneKey& key : scene_keys()) {
    const bool skipped = std::find(skip.begin(), skip.end(), key.name) != skip.end();
    if (key.section == section && !key.fallback.empty() && !skipped) {
      text += key.name + " = " + key.fallback + "\n";
    }
  }
  return text;
}

TEST_F(SceneFiles, DocumentedDefaultsAreTheDefaults) {
  write("ball.obj");
  const std::string lattice = "[[body]]\nshape = 'sphere'\nradius = 1\nphyxels = 10\n";
  const std::string mesh = "[[body]]\nname = 'm'\nmesh = 'ball.obj'\nphyxels = 10\n";
  const std::string motion = "[[body.motion]]\nall = true\n", load = "[[body.load]]\nall = true\n";
  const std::string without = time_section + lattice + material + motion +
                              "velocity = [0, 0, 0]\n" + load + "force = [0, 0, 0]\n" + mesh +
                              material;
  // The motion and load keys with defaults go together only in part; zero vectors say it all.
  const std::string with =
      defaults_of("") + "[time]\nend = 1\n" + defaults_of("time") + "[solver]\n" +
      defaults_of("solver") + "[output]\n" + defaults_of("output") + "[render]\n" +
      defaults_of("render") + lattice + defaults_of("body", {"relaxations"}) + material +
      defaults_of("body.material") + "[body.neighbours]\n" + defaults_of("body.neighbours") +
      motion + defaults_of("body.motion", {"displacement", "rotation", "about", "amplitude"}) +
      load + defaults_of("body.load", {"force_density"}) + mesh +
      defaults_of("body", {"lattice", "jitter", "surfels"}) + material;
  const fs::path file = folder_ / "s.toml";
  EXPECT_EQ(digest(parse_scene(without, file)), digest(parse_scene(with, file)));
}

TEST(SceneReference, ShapesInTheReferenceAreThoseThatExist) {
  for (const SceneKey& key : scene_keys()) {
    if (key.section != "body" || key.name != "shape") continue;
    for (const std::string& name : shape_names()) EXPECT_THAT(key.meaning, HasSubstr(name));
  }
}

TEST(SceneReference, ReferenceNamesEveryKeyWithItsUnitAndDefault) {
  const std::string reference = scene_reference();
  for (const SceneKey& key : scene_keys()) {
    EXPECT_THAT(reference, HasSubstr("| `" + key.name + "` | " + allowed_words(key)))
        << key.section;
    EXPECT_FALSE(key.meaning.empty()) << key.name;
    EXPECT_EQ(key.required + !key.fallback.empty() + !key.otherwise.empty(), 1) << key.name;
  }
}

TEST(SceneReference, DocumentationHoldsTheReference) {
  const std::string page = text_of(PHYXEL_SOURCE_DIR "/docs/scenes.md");
  const std::string begin = "<!-- reference: begin -->\n", end = "<!-- reference: end -->\n";
  const std::size_t from = page.find(begin), to = page.find(end);
  ASSERT_NE(from, std::string::npos);
  ASSERT_NE(to, std::string::npos);
  const std::string written = page.substr(from + begin.size(), to - from - begin.size());
  if (const char* file = std::getenv("PHYXEL_WRITE_REFERENCE")) {
    std::ofstream(file) << page.substr(0, from + begin.size()) << scene_reference()
                        << page.substr(to);
  }
  EXPECT_EQ(written, scene_reference())
      << "the keys have changed: run this test with PHYXEL_WRITE_REFERENCE=docs/scenes.md";
}

}  // namespace
}  // namespace phyxel
