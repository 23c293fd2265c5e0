/// phyxel export: what its files hold is what the run's frames hold.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>

#include "colouring.hpp"
#include "export/gltf_file.hpp"
#include "export/obstacle_mesh.hpp"
#include "model/contact.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "phyxel/physics/rigid.hpp"
#include "phyxel/recorder.hpp"
#include "scene/parse_obstacles.hpp"
#include "support/csv_column.hpp"
#include "support/glb.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Gltf;
using test::Outcome;
using test::read_glb;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::size_t frames = 5;

class Exports : public test::Program {
 protected:
  /// Runs a block that stretches and one that flies, with a floor, a box on a path and a free
  /// ball, for 0.04 s.
  void SetUp() override {
    write("scene.toml", R"(
title = "two blocks & \"more\""
gravity = [0, 0, -9.81]
[time]
end = 0.04
step = 0.0005
[solver]
device = "cpu"
[output]
directory = "out"
frames_per_second = 100
fields = ["displacement", "velocity", "von_mises", "stress"]
[[body]]
name = "low"
shape = "block"
size = [1, 1, 1]
spacing = 0.125
translation = [0, 0, 1]
velocity = [0, 0, 2]
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[body.fixed]]
region = "z-"
[[body]]
name = "far"
shape = "block"
size = [1, 2, 1]
spacing = 0.125
translation = [1000, 0, 2]
velocity = [3, 0, 0]
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[obstacle]]
name = "floor"
shape = "plane"
[[obstacle]]
name = "gate"
shape = "box"
size = [1, 2, 4]
rotation = [0, 0, 170]
translation = [0, 8, 3]
motion = { rotation = [0, 0, 20], displacement = [0, 1, 0], duration = 0.04 }
[[obstacle]]
name = "ball"
shape = "sphere"
radius = 2
density = 500
translation = [0, -8, 5]
)");
    const Outcome done = run({"run", "scene.toml"});
    ASSERT_EQ(done.code, 0) << done.err;
    const auto entries = read_series(folder_ / "out" / "surface.hdf.series");
    for (const SeriesEntry& entry : entries) surfaces_.push_back(read_frame(entry.file, true));
    ASSERT_EQ(surfaces_.size(), frames);
  }
  Outcome exported(const std::string& format, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"export", "out", "--format", format};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  }
  /// Reads an export with readers that are not ours. @returns their exit code
  int read_back(const std::string& what, const std::string& exported) const {
    const char* named = std::getenv("PHYXEL_PYTHON");
    const std::string command = std::string(named ? named : "/usr/bin/python3") +
                                " -B '" PHYXEL_SOURCE_DIR "/tests/read_exports.py' " + what + " '" +
                                (folder_ / exported).string() + "' '" + (folder_ / "out").string() +
                                "'";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  /// Numbers of the surfels of a body.
  std::vector<std::size_t> surfels_of(Index body) const {
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < surfaces_[0].body.size(); ++k) {
      if (surfaces_[0].body[k] == body) found.push_back(k);
    }
    return found;
  }

  std::vector<FrameData> surfaces_;
};
constexpr int no_reader = 77;

Vec3d vector_at(const std::vector<float>& numbers, std::size_t k) {
  return {numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]};
}

Vec3d vector_of(const nlohmann::json& json) {
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

/// The rotation of a quaternion as glTF stores it.
template <class Numbers>
Mat3d rotation_from(const Numbers& q, std::size_t first = 0) {
  return rotation_of(UnitQuaternion{q[first + 3], {q[first], q[first + 1], q[first + 2]}});
}

TEST_F(Exports, GltfMovesAsTheRun) {
  const Outcome done = exported("glb");
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("out/surface.glb: 5 frames"));
  const Gltf gltf = read_glb(folder_ / "out" / "surface.glb");
  ASSERT_EQ(gltf.times().size(), frames);
  for (std::size_t k = 0; k < frames; ++k) EXPECT_NEAR(gltf.times()[k], surfaces_[k].time, 1e-6);
  for (const Index body : {0, 1}) {
    const std::size_t node = gltf.node("body " + std::to_string(body + 1));
    const Vec3d origin = vector_of(gltf.json["nodes"][node]["translation"]);
    const std::vector<std::size_t> surfels = surfels_of(body);
    ASSERT_FALSE(surfels.empty());
    // At each frame its own target counts, and no other.
    const std::vector<float> weights = gltf.keyframes(node, "weights");
    ASSERT_EQ(weights.size(), frames * (frames - 1));
    for (std::size_t k = 0; k < weights.size(); ++k) {
      EXPECT_EQ(weights[k], k / (frames - 1) == k % (frames - 1) + 1 ? 1 : 0);
    }
    for (std::size_t k = 0; k < frames; ++k) {
      const std::vector<float> position = gltf.morphed(node, "POSITION", k),
                               normal = gltf.morphed(node, "NORMAL", k);
      ASSERT_EQ(position.size(), 3 * surfels.size());
      for (std::size_t s = 0; s < surfels.size(); ++s) {
        // Also of the body that is a thousand metres away.
        const Vec3d place = origin + vector_at(position, s);
        EXPECT_LT(norm(place - surfaces_[k].point[surfels[s]]), 1e-6) << body << " " << k;
        EXPECT_LT(norm(vector_at(normal, s) - surfaces_[k].normal[surfels[s]]), 1e-6);
      }
    }
  }
}

TEST_F(Exports, GltfHasTheTrianglesAndBoundsOfEachBody) {
  ASSERT_EQ(exported("glb").code, 0);
  const Gltf gltf = read_glb(folder_ / "out" / "surface.glb");
  std::size_t triangles = 0;
  for (const Index body : {0, 1}) {
    const std::size_t node = gltf.node("body " + std::to_string(body + 1));
    const auto& part = gltf.primitive(node);
    const std::vector<std::size_t> surfels = surfels_of(body);
    const auto corners = gltf.values<std::uint32_t>(part["indices"]);
    std::vector<Triangle> expected, found;
    for (const Triangle& triangle : surfaces_[0].triangle) {
      if (surfaces_[0].body[static_cast<std::size_t>(triangle[0])] == body) {
        expected.push_back(triangle);
      }
    }
    for (std::size_t c = 0; c + 2 < corners.size(); c += 3) {
      Triangle& triangle = found.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        triangle[k] = static_cast<Index>(surfels.at(corners[c + k]));
      }
    }
    EXPECT_EQ(found, expected);
    triangles += found.size();
    std::vector<nlohmann::json> positions{part["attributes"]["POSITION"]};
    for (const auto& target : part["targets"]) positions.push_back(target["POSITION"]);
    for (const auto& accessor : positions) {
      const std::vector<float> numbers = gltf.values<float>(accessor);
      const auto& stated = gltf.json["accessors"][accessor.get<std::size_t>()];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        float low = numbers[axis], high = low;
        for (std::size_t k = axis; k < numbers.size(); k += 3) {
          low = std::min(low, numbers[k]);
          high = std::max(high, numbers[k]);
        }
        EXPECT_EQ(stated["min"][axis].get<float>(), low);
        EXPECT_EQ(stated["max"][axis].get<float>(), high);
      }
    }
  }
  EXPECT_EQ(triangles, surfaces_[0].triangle.size());
  const auto colour = [&](const char* name) {
    const auto material = gltf.primitive(gltf.node(name))["material"].get<std::size_t>();
    return vector_of(gltf.json["materials"][material]["pbrMetallicRoughness"]["baseColorFactor"]);
  };
  EXPECT_LT(norm(colour("body 1") - to<double>(app::body_colour(0))), 1e-6);
  EXPECT_LT(norm(colour("body 2") - to<double>(app::body_colour(1))), 1e-6);
}

TEST_F(Exports, GltfHasObstaclesWhereTheyAre) {
  ASSERT_EQ(exported("glb").code, 0);
  const Gltf gltf = read_glb(folder_ / "out" / "surface.glb");
  // The vertical of the scene is that of glTF, which is y.
  const auto& root = gltf.json["nodes"][gltf.json["scenes"][0]["nodes"][0].get<std::size_t>()];
  EXPECT_EQ(root["children"].size(), 5u);
  const Mat3d turn = rotation_from(root["rotation"].get<std::vector<double>>());
  EXPECT_LT(norm(turn * Vec3d{0, 0, 1} - Vec3d{0, 1, 0}), 1e-12);

  const Scene scene = parse_obstacles(test::text_of(folder_ / "scene.toml"), "scene.toml");
  const std::vector<Obstacle> obstacles = obstacles_of(scene);
  for (std::size_t o : {0u, 1u}) {
    const Obstacle& obstacle = obstacles[o];
    const std::size_t node = gltf.node(obstacle.name);
    const auto vertices = gltf.values<float>(gltf.primitive(node)["attributes"]["POSITION"]);
    const auto translations = gltf.keyframes(node, "translation"),
               rotations = gltf.keyframes(node, "rotation");
    EXPECT_EQ(translations.size(), o == 0 ? 0 : 3 * frames);
    // Quaternions keep their sign where the angle passes 180 degrees.
    for (std::size_t k = 4; k < rotations.size(); k += 4) {
      double product = 0;
      for (std::size_t c = 0; c < 4; ++c) product += rotations[k + c] * rotations[k + c - 4];
      EXPECT_GT(product, 0.9);
    }
    for (std::size_t k = 0; k < frames; ++k) {
      const auto& fixed = gltf.json["nodes"][node];
      const Vec3d place = o == 0 ? vector_of(fixed["translation"]) : vector_at(translations, k);
      const Mat3d rotation = o == 0 ? rotation_from(fixed["rotation"].get<std::vector<double>>())
                                    : rotation_from(rotations, 4 * k);
      const ObstacleStep step = obstacle.step_from(surfaces_[k].time, 0);
      ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
        for (std::size_t v = 0; 3 * v < vertices.size(); ++v) {
          const Vec3d x = rotation * vector_at(vertices, v) + place;
          EXPECT_NEAR(gap_to(shape, step, x).distance, 0, 1e-5) << obstacle.name << " " << k;
        }
      });
    }
  }
  // A free body falls as its log has it.
  const auto heights =
      test::csv_column(test::text_of(folder_ / "out" / "rigid.csv"), "place_z", "ball");
  const auto places = gltf.keyframes(gltf.node("ball"), "translation");
  ASSERT_EQ(heights.size(), frames);
  ASSERT_EQ(places.size(), 3 * frames);
  for (std::size_t k = 0; k < frames; ++k) EXPECT_NEAR(places[3 * k + 2], heights[k], 1e-6);
  EXPECT_NEAR(heights[frames - 1], 5 - 0.5 * 9.81 * 0.04 * 0.04, 1e-4);
}

TEST_F(Exports, GltfHasTheColoursOfAField) {
  ASSERT_EQ(exported("glb", {"--colour", "von_mises", "--range", "0,5000", "--out", "c.glb"}).code,
            0);
  const Gltf gltf = read_glb(folder_ / "c.glb");
  const app::Colouring colouring{"von_mises", {0, 5000}, {}};
  double most = 0;
  for (std::size_t k = 0; k < frames; ++k) {
    for (const Index body : {0, 1}) {
      const std::size_t node = gltf.node("body " + std::to_string(body + 1));
      const auto colours = gltf.morphed(node, "COLOR_0", k);
      const std::vector<std::size_t> surfels = surfels_of(body);
      ASSERT_EQ(colours.size(), 3 * surfels.size());
      for (std::size_t s = 0; s < surfels.size(); ++s) {
        const double value = surfaces_[k].field.at("von_mises")[surfels[s]];
        most = std::max(most, value);
        const Vec3d expected = to<double>(app::field_colour(value, colouring));
        EXPECT_LT(norm(vector_at(colours, s) - expected), 1e-6);
      }
    }
  }
  EXPECT_GT(most, 1000);  // it is not the same colour everywhere
  EXPECT_EQ(gltf.json["asset"]["extras"]["colours"]["high"], 5000);
  const Outcome wrong = exported("glb", {"--colour", "heat", "--out", "d.glb"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("--colour heat: the frames have no such number or vector; "
                                   "allowed: displacement, "));
  EXPECT_FALSE(fs::exists(folder_ / "d.glb"));
}

TEST_F(Exports, GltfAsTextHoldsTheSame) {
  ASSERT_EQ(exported("glb", {"--out", "a.glb"}).code, 0);
  ASSERT_EQ(exported("gltf", {"--out", "a.gltf"}).code, 0);
  const Gltf binary = read_glb(folder_ / "a.glb");
  Gltf text;
  text.json = nlohmann::json::parse(test::text_of(folder_ / "a.gltf"));
  const std::string uri = text.json["buffers"][0]["uri"], head = "data:application/octet-stream;";
  ASSERT_EQ(uri.substr(0, head.size()), head);
  text.bytes = test::decoded(uri.substr(uri.find(',') + 1));
  EXPECT_EQ(text.bytes, binary.bytes);
  text.json["buffers"][0].erase("uri");
  EXPECT_EQ(text.json, binary.json);
}

TEST_F(Exports, GltfOfSomeFramesAndOfAnotherPace) {
  ASSERT_EQ(exported("glb", {"--frames", "1,-1", "--seconds", "6", "--out", "slow.glb"}).code, 0);
  const Gltf slow = read_glb(folder_ / "slow.glb");
  EXPECT_EQ(slow.times(), (std::vector<float>{0, 6}));
  EXPECT_EQ(slow.json["asset"]["extras"]["times"],
            (nlohmann::json{surfaces_[1].time, surfaces_[4].time}));
  const std::size_t node = slow.node("body 1");
  const Vec3d origin = vector_of(slow.json["nodes"][node]["translation"]);
  const std::size_t first = surfels_of(0)[0];
  EXPECT_LT(
      norm(origin + vector_at(slow.morphed(node, "POSITION", 0), 0) - surfaces_[1].point[first]),
      1e-6);
  EXPECT_LT(
      norm(origin + vector_at(slow.morphed(node, "POSITION", 1), 0) - surfaces_[4].point[first]),
      1e-6);
  // A single frame has nothing that moves.
  ASSERT_EQ(exported("glb", {"--count", "1", "--out", "one.glb"}).code, 0);
  const Gltf one = read_glb(folder_ / "one.glb");
  EXPECT_FALSE(one.json.contains("animations"));
  EXPECT_FALSE(one.primitive(one.node("body 1")).contains("targets"));
}

TEST_F(Exports, GltfThatWouldBeTooLargeHasFewerFrames) {
  ASSERT_EQ(exported("glb", {"--out", "all.glb"}).code, 0);
  const double all = static_cast<double>(fs::file_size(folder_ / "all.glb"));
  const auto limited = [&](double megabytes) {
    return exported("glb", {"--max-megabytes", std::to_string(megabytes), "--out", "some.glb"});
  };
  const Outcome none = limited(0.002);
  EXPECT_EQ(none.code, 2);
  EXPECT_THAT(none.err, HasSubstr("allowed: a larger --max-megabytes, or --count 1"));
  EXPECT_FALSE(fs::exists(folder_ / "some.glb"));
  const Outcome some = limited(0.9e-6 * all);
  ASSERT_EQ(some.code, 0) << some.err;
  EXPECT_THAT(some.err, HasSubstr("of 5 frames are exported, evenly spaced"));
  EXPECT_LT(static_cast<double>(fs::file_size(folder_ / "some.glb")), 0.9 * all);
  const Gltf gltf = read_glb(folder_ / "some.glb");
  EXPECT_LT(gltf.times().size(), frames);
  EXPECT_NEAR(gltf.times().back(), 0.04, 1e-6);
}

TEST_F(Exports, OtherReadersReadGltf) {
  ASSERT_EQ(exported("glb").code, 0);
  ASSERT_EQ(exported("gltf").code, 0);
  for (const char* file : {"out/surface.glb", "out/surface.gltf"}) {
    const int code = read_back("gltf", file);
    PHYXEL_NEEDS_TOOL(code != no_reader, "python3-vtk9");
    EXPECT_EQ(code, 0) << file;
  }
}

TEST_F(Exports, VtkReadsVtu) {
  const Outcome done = exported("vtu");
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("out/vtu: 5 frames"));
  const int code = read_back("vtu", "out/vtu");
  PHYXEL_NEEDS_TOOL(code != no_reader, "python3-vtk9");
  EXPECT_EQ(code, 0);
}

TEST_F(Exports, MeshioReadsVtu) {
  ASSERT_EQ(exported("vtu", {"--out", "frames"}).code, 0);
  const int code = read_back("meshio", "frames");
  PHYXEL_NEEDS_TOOL(code != no_reader, "python3-meshio");
  EXPECT_EQ(code, 0);
}

TEST_F(Exports, AStateOfParaViewShowsTheRun) {
  for (const char* scale : {"linear", "log"}) {
    const Outcome done =
        exported("paraview", {"--colour", "von_mises", "--scale", scale, "--force"});
    ASSERT_EQ(done.code, 0) << done.err;
    const int code = read_back("paraview", "out/open_in_paraview.py");
    PHYXEL_NEEDS_TOOL(code != no_reader, "python3-vtk9");
    EXPECT_EQ(code, 0) << scale;
  }
  const Outcome wrong = exported("paraview", {"--out", "paraview.py"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("--out paraview.py: is the name of ParaView's own module"));
}

TEST_F(Exports, WrongRequestsAreRefused) {
  const struct {
    std::vector<std::string> words;
    const char* why;
  } cases[] = {
      {{"export", "out"}, "allowed: one of --format and --single"},
      {{"export", "out", "--format", "fbx"}, "--format"},
      {{"export", "out", "--format", "vtu", "--colour", "von_mises"},
       "--colour with --format vtu: allowed: --out, --frames, --count, --every"},
      {{"export", "out", "--format", "paraview", "--frames", "1"},
       "--frames with --format paraview: allowed: --out, --colour, --range, --scale"},
      {{"export", "out/surface.hdf.series", "--single", "x.vtkhdf", "--count", "2"},
       "--count with --single: allowed: --force"},
      {{"export", "out", "--format", "glb", "--frames", "5"}, "frame 5: there are 5"},
      {{"export", "out", "--format", "glb", "--seconds", "0"}, "--seconds"},
      {{"export", "out/phyxels.hdf.series", "--format", "glb", "--out", "x.glb"},
       "holds phyxels only, and glTF has surfaces"},
      {{"export", "scene.toml", "--format", "glb"}, "is a scene"},
  };
  for (const auto& wrong : cases) {
    const Outcome done = run(wrong.words);
    EXPECT_EQ(done.code, 2) << wrong.why;
    EXPECT_THAT(done.err, HasSubstr(wrong.why));
  }
  for (const char* file : {"out/surface.glb", "x.glb", "x.vtkhdf", "out/vtu"}) {
    EXPECT_FALSE(fs::exists(folder_ / file)) << file;
  }
  // What exists stays, and with it the files that would have been written beside it.
  write("mine/phyxels.pvd", "mine");
  write("mine.glb", "mine");
  write("mine.py", "mine");
  for (const auto& [format, file] : std::map<std::string, std::string>{
           {"vtu", "mine"}, {"glb", "mine.glb"}, {"paraview", "mine.py"}}) {
    const Outcome kept = exported(format, {"--out", file});
    EXPECT_EQ(kept.code, 2);
    EXPECT_THAT(kept.err, HasSubstr("exists already and is kept"));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "mine"), {}), 1);
  ASSERT_EQ(exported("glb", {"--out", "mine.glb", "--force"}).code, 0);
  EXPECT_NE(test::text_of(folder_ / "mine.glb"), "mine");
}

/// Also those that have as many points and triangles, as a block that lies has.
TEST_F(Exports, FramesWithOtherTrianglesAreRefused) {
  std::string text = test::text_of(folder_ / "scene.toml");
  for (const auto& [old, other] : {std::pair<std::string, std::string>{"[1, 2, 1]", "[2, 1, 1]"},
                                   {"directory = \"out\"", "directory = \"other\""}}) {
    text.replace(text.find(old), old.size(), other);
  }
  write("scene.toml", text);
  ASSERT_EQ(run({"run", "scene.toml"}).code, 0);
  const FrameData other = read_frame(folder_ / "other" / "surface_000003.hdf");
  ASSERT_EQ(other.point.size(), surfaces_[3].point.size());
  ASSERT_EQ(other.body, surfaces_[3].body);
  fs::copy_file(folder_ / "other" / "surface_000003.hdf", folder_ / "out" / "surface_000003.hdf",
                fs::copy_options::overwrite_existing);
  const Outcome done = exported("glb");
  EXPECT_EQ(done.code, 2);
  EXPECT_THAT(done.err, HasSubstr("surface_000003.hdf: has other points or triangles"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "surface.glb"));
}

TEST(Quaternions, TurnAsTheirMatrices) {
  for (const double angle : {0.0, 1e-9, 0.5, 2.0, 3.14159265358979, 4.0, 6.0}) {
    for (const Vec3d axis :
         {Vec3d{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 2, 0.5}, {1, 1, 1}, {0.1, -3, 0}}) {
      const UnitQuaternion q{std::cos(angle / 2), std::sin(angle / 2) * normalised(axis)};
      const Mat3d expected = rotation_of(q);
      const auto found = app::quaternion_of(expected);
      EXPECT_GE(found[3], 0);
      const Mat3d turned = rotation_from(found);
      for (int e = 0; e < 9; ++e) EXPECT_NEAR(turned(e / 3, e % 3), expected(e / 3, e % 3), 1e-12);
    }
  }
}

}  // namespace
}  // namespace phyxel
