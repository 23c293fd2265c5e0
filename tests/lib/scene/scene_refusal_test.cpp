/// What each wrong scene file is told.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "scene/scene_schema.hpp"
#include "support/scene_with.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

struct Malformed {
  std::string text;
  std::string where;    // "line:column"
  std::string message;  // part of it
};

/// A scene whose body, on line 3, is `lines`.
std::string body_of(const std::string& lines) {
  return time_section + "[[body]]\n" + lines + "\n" + material;
}
/// A scene with `line` on line 1.
std::string on_top(const std::string& line) { return line + "\n" + time_section + dino; }
/// A scene with `line` on line 10, in its section.
std::string in_section(const std::string& section, const std::string& line) {
  return time_section + dino + "[" + section + "]\n" + line + "\n";
}
/// A scene whose material is these lines, from line 6 on.
std::string of_material(const std::string& lines) {
  return time_section + "[[body]]\nshape = 'dino'\n[body.material]\n" + lines;
}

/// A scene with a load whose curve, on line 15, is `text`.
std::string with_curve(const std::string& text) {
  return after_beam("[[body.load]]\nall = true\nforce = [0, 0, 1]\ncurve = " + text + "\n");
}

const std::vector<Malformed>& malformed() {
  static const std::vector<Malformed> table = {
      // Not TOML
      {"title = \"open", "1:14", "not valid TOML"},
      {"title = 'a'\ntitle = 'b'\n", "2:9", "cannot redefine existing string"},
      {"[time\nend = 1\n", "1:6", "not valid TOML"},
      {"\xc3\xbc = 1\n", "1:1", "a letter beyond ASCII; allowed: only in comments and in quotes"},
      {"title = 'a'\n\xef\xbb\xb8 = 1\n", "2:1", "a letter beyond ASCII"},
      {"x = \"\"\"a\\\n \xef\xbb\xbb\"\"\"\n", "1:5", "not right behind a backslash"},
      {"x = a'\xef\xb9\xb8'\n", "1:6", "a letter beyond ASCII"},
      {"end 1\n", "1:5", "not valid TOML"},
      {time_section + "\n[{body]]\n", "4", "not valid TOML: no key, value or section"},
      {"title = '\xff\xfe'\n", "1:9", "invalid utf-8"},
      {std::string("title = '\0'\n", 12), "1:10", "not valid TOML"},
      {"a = [[[[[[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]]]]]]\n", "1:", "not valid TOML"},
      {"[a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r]\n", "1:33", "a key of more than 16 parts"},
      // At the top
      {"", "1:1", "key body: missing; needed: [[body]], once or more"},
      {dino, "1:1", "key time: missing; needed: [time]"},
      {time_section + "[solver]\nmethod = 'implicit'\nprecision = 'float'\n" + dino, "5:13",
       "\"float\" found; allowed with method = \"implicit\": \"double\""},
      {time_section, "1:1", "key body: missing; needed: [[body]], once or more"},
      {on_top("gravty = [0, 0, 1]"), "1:1", "unknown (did you mean \"gravity\"?)"},
      {on_top("k_v = 3"), "1:1", "key k_v: unknown; allowed at the top of the file: title"},
      {on_top("young = 3"), "1:1", "unknown here, but known in [body.material]"},
      {on_top("\"a\\nb\" = 3"), "1:1", "key \"a\\x0ab\": unknown"},
      {on_top("title = 3"), "1:9", "key title: 3 found; allowed: text"},
      {on_top("title = ''"), "1:9", "\"\" found"},
      {on_top("title = 'a\tb'"), "1:9", "\"a\\x09b\" found"},
      {on_top("gravity = -9.81"), "1:11",
       "-9.81 found; allowed: [x, y, z], -1e+12 <= each <= 1e+12 [m/s^2]"},
      {on_top("gravity = [0, 0]"), "1:11", "[0, 0] found"},
      {on_top("gravity = [0, 0, 'down']"), "1:18", "\"down\" found"},
      {on_top("gravity = [0, 0, nan]"), "1:18", "nan found"},
      {on_top("gravity = [0, 0, -inf]"), "1:18", "-inf found"},
      {on_top("gravity = 2020-01-01"), "1:11", "a date or time found"},
      {"time = 3\n" + dino, "1:8", "key time: 3 found; allowed: [time]"},
      {time_section + "[body]\nshape = 'dino'\n", "3:1", "a table found; allowed: [[body]]"},
      {"body = []\n" + time_section, "1:8", "an empty list found; allowed: [[body]]"},
      // [time]
      {"[time]\n" + dino, "1:1", "key time.end: missing; needed: a number, 0 < end"},
      {"[time]\nend = 0\n" + dino, "2:7", "key time.end: 0 found; allowed: a number, 0 < end"},
      {"[time]\nend = -1.5\n" + dino, "2:7", "-1.5 found"},
      {"[time]\nend = '1'\n" + dino, "2:7", "\"1\" found"},
      {"[time]\nend = 1\nstep = 'fast'\n" + dino, "3:8", "\"fast\" found"},
      {"[time]\nend = 1\nstep = 0\n" + dino, "3:8",
       "\"adaptive\" or a number, 1e-18 <= step <= 1e+09 [s]"},
      {"[time]\nend = 1\nsafety = 1\n" + dino, "3:10", "0 < safety < 1"},
      {"[time]\nend = 1\nsafety = 0.5\nstep = 0.1\n" + dino, "3:10", "found together with step"},
      {"[time]\nends = 1\n" + dino, "2:1", "key time.ends: unknown (did you mean \"end\"?)"},
      // [solver], [output], [render]
      {in_section("solver", "device = 'gpu'"), "10:10", "allowed: \"auto\", \"cpu\", \"cuda\""},
      {in_section("solver", "precision = 'doubel'"), "10:13", "(did you mean \"double\"?)"},
      {in_section("solver", "threads = 2.0"), "10:11", "2.0 found; allowed: an integer"},
      {in_section("solver", "threads = -1"), "10:11", "0 <= threads <= 4096"},
      {in_section("output", "directory = ''"), "10:13", "\"\" found; allowed: a path"},
      {in_section("output", "frames_per_second = -1"), "10:21", "-1 found"},
      {in_section("output", "phyxels = 1"), "10:11", "1 found; allowed: true or false"},
      {in_section("output", "fields = ['speed']"), "10:11", "\"speed\" found"},
      {in_section("output", "fields = ['velocty']"), "10:11", "(did you mean \"velocity\"?)"},
      {in_section("output", "fields = ['mass', 'mass']"), "10:19", "each at most once"},
      {in_section("output", "checkpoint_every = true"), "10:20", "true found; allowed: a number"},
      {in_section("render", "width = 8"), "10:9", "16 <= width <= 8192 [pixels]"},
      {in_section("render", "view = [0, 0, 0]"), "10:8", "allowed: not zero"},
      {in_section("render", "view = [0, 0, -2]"), "10:8", "are parallel"},
      {in_section("render", "view = [0, 1, 0]\nup = [0, -3, 0]"), "10:8", "are parallel"},
      {in_section("render", "camera = { field_of_view = 200 }"), "10:28",
       "1 <= field_of_view <= 150 [degrees]"},
      {in_section("render", "camera = { follow = 'cow' }"), "10:21",
       "key render.camera.follow: \"cow\" found, which no body is called; allowed: \"dino\""},
      {in_section("render", "camera = { position = [1, 0, 0], target = [1, 0, 0] }"), "10:43",
       "the place of the camera found"},
      {in_section("render",
                  "view = [1, 0, 0]\ncamera = { position = [1, 0, 0], target = [0, 0, 0] }"),
       "10:8", "found beside camera.position and camera.target"},
      {in_section("render",
                  "camera = { position = [0, 0, 3], target = [0, 0, 0] }\nup = [0, 0, 1]"),
       "11:6", "are parallel"},
      // [[body]]: where it comes from
      {body_of(""), "3:1", "body: a key is missing; needed: exactly one of: shape, mesh, file"},
      {body_of("shape = 'dnio'"), "4:9", "\"dnio\" found (did you mean \"dino\"?); allowed: "},
      {body_of("shape = 'dino'\nfile = 'a.h5'"), "5:8", "found together with shape"},
      {body_of("shape = 'dino'\nphyxels = 5"), "5:11", "shape = \"dino\" does not use it"},
      {body_of("shape = 'beam'\nspacing = 0.1"), "4:9", "key body.size: missing"},
      {body_of("shape = 'sphere'\nspacing = 0.1"), "4:9", "key body.radius: missing"},
      {body_of("shape = 'cylinder'\nradius = 1\nspacing = 0.1"), "4:9", "key body.length: missing"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]"), "3:1", "exactly one of: spacing, phyxels"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]\nspacing = 0.1\nphyxels = 9"), "7:11",
       "found together with spacing"},
      {body_of("shape = 'beam'\nsize = [1, 0, 1]\nspacing = 0.1"), "5:12",
       "1e-12 <= each <= 1e+12 [m]"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]\nspacing = -0.1"), "6:11",
       "1e-12 <= spacing <= 1e+12 [m]"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]\nphyxels = 0"), "6:11", "0 found"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]\nphyxels = 3000000000"), "6:11", "2147483647"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]\nspacing = 0.1\njitter = 0.6"), "7:10", "0.5"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]\nspacing = 0.1\nseed = 2"), "7:8",
       "found without jitter"},
      {body_of("shape = 'beam'\nsize = [1, 1, 1]\nspacing = 0.1\nradius = 2"), "7:10",
       "does not use it; allowed with shape = \"beam\": size, spacing"},
      {body_of("mesh = 'no.obj'\nphyxels = 5"), "4:8", "there is no such file"},
      {body_of("mesh = 'no.obj'"), "4:8", "key body.phyxels: missing; mesh needs it"},
      {body_of("mesh = '.'\nphyxels = 5"), "4:8", "which is a folder"},
      {body_of("file = 'no.h5'"), "4:8", "there is no such file"},
      {body_of("file = 'no.h5'\nseed = 1"), "5:8", "file does not use it"},
      {body_of("mesh = 'a\\u0000b'\nphyxels = 5"), "4:8", "there is no such file"},
      {body_of("mesh = \"a\\u0000b\"\nphyxels = 5"), "4:8", "\"a\\x00b\" found; allowed: a path"},
      // [[body]]: the rest
      {body_of("shape = 'dino'\nscale = 0"), "5:9", "1e-12 <= scale <= 1e+12"},
      {body_of("shape = 'dino'\nvolumes = 'mass'"), "5:11", "\"automatic\", \"geometry\""},
      {body_of("shape = 'dino'\nspin = 3"), "5:8",
       "3 found; allowed: [x, y, z], -1e+09 <= each <= 1e+09 [rad/s]"},
      {time_section + dino + dino, "9:1", "\"dino\" found, the name of the body at scene.toml:3:1"},
      {time_section + dino + "[body.array]\ncount = [2, 1, 1]\nspacing = [1, 0, 0]\n" +
           "[[body]]\nname = 'dino 2'\nshape = 'dino'\n" + material,
       "13:8", "\"dino 2\" found, the name of the body at scene.toml:3:1"},
      {time_section + "[[body]]\nshape = 'dino'\n", "3:1", "key body.material: missing"},
      // [body.material]
      {of_material("poisson = 0.3\ndensity = 1\n"), "5:1", "key body.material.young: missing"},
      {of_material("young = 0\npoisson = 0.3\ndensity = 1\n"), "6:9",
       "0 found; allowed: a number, 1e-12 <= young <= 1e+18 [Pa]"},
      {of_material("young = 1\npoisson = 0.5\ndensity = 1\n"), "7:11", "-1 < poisson < 0.5"},
      {of_material("young = 1\npoisson = -1\ndensity = 1\n"), "7:11", "-1 < poisson < 0.5"},
      {of_material("young = 1\npoisson = 0\ndensity = -1\n"), "8:11",
       "1e-12 <= density <= 1e+18 [kg/m^3]"},
      {of_material("young = 1\npoisson = 0\ndensity = 1\nlaw = 'corotate'\n"), "9:7",
       "\"corotated\"?"},
      {of_material("young = 1\npoisson = 0\ndensity = 1\ndamping = -1\n"), "9:11",
       "0 <= damping <= 1e+12"},
      // [body.neighbours], [body.array]
      {in_section("body.neighbours", "factor = 0.5"), "10:10", "1 <= factor <= 20"},
      {in_section("body.neighbours", "max_neighbours = 0"), "10:18", "0 found"},
      {in_section("body.neighbours", "factor = 2\nradius = 0.1"), "10:10", "together with radius"},
      {in_section("body.neighbours", "support = 'adaptive'\nradius = 1"), "10:11", "with radius"},
      {in_section("body.neighbours", "support = 'pairwise'\nmax_neighbours = 9"), "10:11",
       "with max_neighbours"},
      {in_section("body.neighbours", "neerest = 3"), "10:1", "(did you mean \"nearest\"?)"},
      {in_section("body.array", "count = [2, 1]\nspacing = [1, 0, 0]"), "10:9", "three integers"},
      {in_section("body.array", "count = [2, 1, 0]\nspacing = [1, 0, 0]"), "10:16", "0 found"},
      {in_section("body.array", "count = [2, 1, 2]\nspacing = [1, 0, 0]"), "11:11", "in one place"},
      {in_section("body.array", "count = [99, 99, 99]\nspacing = [1, 1, 1]"), "10:9",
       "970299 copies found; allowed: at most 10000"},
      // Selections, motions, loads
      {after_beam("[[body.fixed]]\n"), "12:1",
       "exactly one of: region, indices, box, ball, mesh, all"},
      {after_beam("[[body.fixed]]\nregion = 'x-'\nall = true\n"), "14:7", "together with region"},
      {after_beam("[[body.fixed]]\nregion = ''\n"), "13:10", "\"\" found"},
      {after_beam("[[body.fixed]]\nall = false\n"), "13:7", "selects nothing; allowed: true"},
      {after_beam("[[body.fixed]]\nindices = []\n"), "13:11", "an empty list found"},
      {after_beam("[[body.fixed]]\nindices = [1, -1]\n"), "13:15", "-1 found"},
      {after_beam("[[body.fixed]]\nindices = [1, 2.5]\n"), "13:15", "2.5 found"},
      {after_beam("[[body.fixed]]\nbox = [[0, 0, 0], [1, 1]]\n"), "13:19", "[1, 1] found"},
      {after_beam("[[body.fixed]]\nbox = [[0, 0, 0], [1, -1, 1]]\n"), "13:7", "lowest <= highest"},
      {after_beam("[[body.fixed]]\nball = {centre = [0, 0, 0]}\n"), "13:8",
       "key body.fixed.ball.radius: missing"},
      {after_beam("[[body.fixed]]\nball = {centre = [0, 0, 0], radius = 0}\n"), "13:38",
       "key body.fixed.ball.radius: 0 found"},
      {after_beam("[[body.fixed]]\nregoin = 'x-'\n"), "13:1", "(did you mean \"region\"?)"},
      {after_beam("[[body.fixed]]\nregion = 'x-'\nvelocity = [0, 0, 0]\n"), "14:1",
       "unknown here, but known in [[body]] and in [[body.motion]]"},
      {after_beam("[body.fixed]\nregion = 'x-'\n"), "12:1",
       "allowed: [[body.fixed]], once or more"},
      {after_beam("[[body.motion]]\nall = true\n"), "12:1", "at least one of: displacement"},
      {after_beam("[[body.motion]]\nall = true\ndisplacement = [1, 0, 0]\n"), "14:16",
       "found without duration"},
      {after_beam("[[body.motion]]\nall = true\nvelocity = [1, 0, 0]\nfrequency = 3\n"), "15:13",
       "found without amplitude"},
      {after_beam("[[body.motion]]\nall = true\ndisplacement = [1, 0, 0]\nduration = 0\n"), "15:12",
       "1e-18 <= duration <= 1e+09 [s]"},
      {after_beam("[[body.load]]\nall = true\n"), "12:1", "exactly one of: force, force_density"},
      {after_beam("[[body.load]]\nall = true\nforce = [0, 0, 1]\nforce_density = [0, 0, 1]\n"),
       "15:17", "found together with force"},
      {after_beam("[[body.load]]\nall = true\nforce = [0, 0, 1]\nramp = -1\n"), "15:8",
       "0 <= ramp <= 1e+09"},
      {with_curve("[]"), "15:9", "body.load.curve: an empty list found; allowed: [[t, f], ...]"},
      {with_curve("[[0, 0], [2, 1], [2, 0]]"), "15:26", "[2, 0] found; allowed: [[t, f], ...], 1 "},
      {with_curve("[[0, 0], [2, 1], [1, 0]]"), "15:26", "times ascend"},
      {with_curve("[[-1, 0]]"), "15:10", "[-1, 0] found; allowed"},
      {with_curve("[[0, nan]]"), "15:10", "[0, nan] found"},
      {with_curve("[[nan, 1]]"), "15:10", "[nan, 1] found"},
      {with_curve("[[0, 1, 2]]"), "15:10", "[0, 1, 2] found"},
      {with_curve("[0, 1]"), "15:10", "0 found"},
      {with_curve("[[0, 1e13]]"), "15:10", "-1e+12 <= f <= 1e+12"},
      {with_curve("[[0, 1]]\nramp = 1"), "15:9", "found together with ramp; allowed: only one"},
  };
  return table;
}

TEST(SceneRefusal, EveryMalformedSceneIsToldWhatIsWrongAndWhere) {
  EXPECT_GE(malformed().size(), 100u);
  for (const Malformed& scene : malformed()) {
    const std::string message = message_of(scene.text);
    EXPECT_THAT(message, StartsWith("scene.toml:" + scene.where)) << scene.text;
    EXPECT_THAT(message, HasSubstr(scene.message)) << scene.text;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST(SceneRefusal, EveryKeyRefusesAWrongType) {
  for (const SceneKey& key : scene_keys()) {
    EXPECT_THAT(message_of(scene_with(key, "1979-05-27")),  // no key takes a date
                HasSubstr(": key " + path_in_file(key) +
                          ": a date or time found; allowed: " + allowed_words(key)));
  }
}

TEST(SceneRefusal, EveryRangeRefusesWhatLiesJustOutside) {
  int tried = 0;
  for (const SceneKey& key : scene_keys()) {
    const bool vector = key.type == KeyType::vector, list = key.type == KeyType::indices;
    const bool whole = list || key.type == KeyType::integer || key.type == KeyType::counts;
    for (const double bound : {key.range.low, key.range.high}) {
      if (!std::isfinite(bound)) continue;
      const double away = std::max(1.0, std::abs(bound) / 2);  // more than rounding
      const double out = key.range.open ? bound : bound + (bound == key.range.low ? -away : away);
      std::string text = whole ? fmt::format("{:.0f}", out) : fmt::format("{:.6e}", out);
      if (vector || key.type == KeyType::counts) text = "[1, 1, " + text + "]";
      if (list) text = "[" + text + "]";
      if (key.type == KeyType::curve) text = "[[0, " + text + "]]";
      const std::string message = message_of(scene_with(key, text));
      EXPECT_THAT(message, StartsWith("scene.toml:")) << text;
      EXPECT_THAT(message, HasSubstr(": key " + path_in_file(key) + ": ")) << text;
      EXPECT_THAT(message, HasSubstr(" found; allowed: " + allowed_words(key))) << text;
      ++tried;
    }
  }
  EXPECT_GT(tried, 40);
}

TEST(SceneRefusal, LongAndStrangeValuesAreShownShort) {
  const std::string message = message_of(on_top("title = '" + std::string(5000, 'x') + "'"));
  EXPECT_THAT(message, HasSubstr("\"" + std::string(60, 'x') + "...\" found"));
  const std::string key = message_of(on_top(std::string(5000, 'y') + " = 3"));
  EXPECT_LT(key.size(), 300u);
  // A word cut inside a letter of two bytes would not be valid UTF-8.
  std::string umlauts = "x";
  for (int i = 0; i < 50; ++i) umlauts += "\xc3\xbc";
  EXPECT_THAT(message_of(on_top("gravity = '" + umlauts + "'")),
              HasSubstr("\"" + umlauts.substr(0, 59) + "...\" found"));
}

TEST(SceneRefusal, HostileNestingIsRefusedBeforeItOverflowsTheStack) {
  std::string dotted = "a";
  for (int i = 0; i < 500000; ++i) dotted += ".a";
  EXPECT_THAT(message_of("[" + dotted + "]\n"), StartsWith("scene.toml:1:33: a key of more than"));
  EXPECT_THAT(message_of("x = 1\n" + dotted + " = 1\n"), StartsWith("scene.toml:2:32: a key"));
  EXPECT_THAT(message_of("x = \"\"\"\n\n'\"\"\"\n" + dotted + " = 1\n"),
              StartsWith("scene.toml:4:32: a key of more than"));
  for (const std::string open : {"[", "{a=", "[{a="}) {
    std::string nested = "x = ";
    for (int i = 0; i < 500000; ++i) nested += open;
    EXPECT_THAT(message_of(nested), StartsWith("scene.toml:1:"));
  }
}

TEST(SceneRefusal, DotsAndLettersInTextAndCommentsAreFree) {
  const std::string dots = std::string(100, '.') + "M\xc3\xbcller";
  const Scene scene = parse_scene(
      "\xef\xbb\xbf# " + dots + "\ntitle = '" + dots + "'\n" + time_section + dino, "scene.toml");
  EXPECT_EQ(scene.title, dots);
  // A quote behind a backslash ends no string, but one behind an escaped backslash does.
  const auto title_of = [&](const std::string& title) {
    return parse_scene("title = " + title + "  # M\xc3\xbcller\n" + time_section + dino,
                       "scene.toml")
        .title;
  };
  EXPECT_EQ(title_of(R"("\"M)"
                     "\xc3\xbc"
                     R"(ller\"")"),
            "\"M\xc3\xbcller\"");
  EXPECT_EQ(title_of(R"("M)"
                     "\xc3\xbc"
                     R"(ller\\")"),
            "M\xc3\xbcller\\");
}

TEST(SceneRefusal, MoreBodiesThanAllowedAreRefused) {
  const std::string array = "[body.array]\ncount = [100, 100, 1]\nspacing = [1, 1, 1]\n";
  EXPECT_EQ(parse_scene(time_section + dino + array, "s.toml").bodies.size(), 10000u);
  EXPECT_THAT(
      message_of(time_section + dino + array + "[[body]]\nname = 'x'\nshape = 'dino'\n" + material),
      StartsWith("scene.toml:12:1: body: more than 10000 bodies found"));
}

TEST_F(SceneFiles, UnreadableFilesAreNamed) {
  const auto message = [](const fs::path& file) -> std::string {
    try {
      read_scene(file);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message(folder_ / "no.toml"), (folder_ / "no.toml").string() + ": no such file");
  EXPECT_THAT(message(folder_), StartsWith(folder_.string() + ": is a folder"));
  EXPECT_THAT(message(folder_ / std::string(300, 'x')), HasSubstr("File name too long"));
  EXPECT_THAT(message(write("empty.toml")), HasSubstr("empty.toml:1:1: key body: missing"));
  EXPECT_THAT(message("/dev/zero"),
              StartsWith("/dev/zero: is a character device; allowed: a scene file"));
}

}  // namespace
}  // namespace phyxel
