/// What is read from scene files.
#include "phyxel/scene.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "phyxel/camera_request.hpp"
#include "phyxel/model.hpp"
#include "phyxel/shapes.hpp"
#include "support/scene_text.hpp"

namespace phyxel {
namespace {

void expect_vector(Vec3d found, Vec3d wanted) {
  EXPECT_EQ(found.x, wanted.x);
  EXPECT_EQ(found.y, wanted.y);
  EXPECT_EQ(found.z, wanted.z);
}

// Every key that can stand beside the others; the rest is in the tests below.
const std::string full_scene = R"(title = "All of it"
gravity = [0.5, -1, -9.81]
[time]
end = 2.5
safety = 0.6
[solver]
device = "cpu"
precision = "mixed"
threads = 3
[output]
directory = "results/all"
frames_per_second = 12.5
phyxels = false
surface = false
fields = ["von_mises", "body"]
checkpoint_every = 60
[render]
pictures = true
count = 4
width = 640
height = 480
view = [0, 1, 0]
up = [1, 0, 0]
[[body]]
name = "bar"
shape = "block"
size = [1, 2, 3]
spacing = 0.25
lattice = "nodes"
jitter = 0.1
seed = 7
surfels = false
scale = 2
rotation = [0, 0, 90]
translation = [1, 2, 3]
velocity = [4, 5, 6]
spin = [7, 8, 9]
volumes = "kernel"
closure = 0.25
[body.material]
young = 2e5
poisson = -0.25
density = 1234
law = "small-strain"
volume_stiffness = 5e4
damping = 0.125
hourglass = 0.0625
[body.neighbours]
support = "adaptive"
nearest = 12
factor = 3
max_neighbours = 20
[[body.fixed]]
region = "x-"
[[body.fixed]]
indices = [5, 3]
[[body.motion]]
box = [[0, 1, 2], [3, 4, 5]]
displacement = [0.1, 0.2, 0.3]
duration = 0.5
velocity = [1, 2, 3]
amplitude = [4, 5, 6]
frequency = 7
[[body.load]]
ball = {centre = [1, 2, 3], radius = 0.5}
force = [10, 20, 30]
ramp = 0.75
[[body.load]]
all = true
force_density = [1, 2, 3]
curve = [[0.5, -1], [2, 1.5]]
)";

TEST(Scene, RunKeysAreReadExactly) {
  const Scene scene = parse_scene(full_scene, "folder/all.toml");
  EXPECT_EQ(scene.title, "All of it");
  EXPECT_EQ(scene.file, "folder/all.toml");
  EXPECT_EQ(scene.text, full_scene);
  expect_vector(scene.gravity, {0.5, -1, -9.81});
  EXPECT_EQ(scene.time.end, 2.5);
  EXPECT_FALSE(scene.time.step.has_value());
  EXPECT_EQ(scene.time.safety, 0.6);
  EXPECT_EQ(scene.solver.device, "cpu");
  EXPECT_EQ(scene.solver.precision, Precision::mixed);
  EXPECT_EQ(scene.solver.threads, 3);
  EXPECT_EQ(scene.output.directory, "folder/results/all");
  EXPECT_EQ(scene.output.frames_per_second, 12.5);
  EXPECT_FALSE(scene.output.phyxels);
  EXPECT_FALSE(scene.output.surface);
  EXPECT_EQ(scene.output.fields, (std::vector<std::string>{"von_mises", "body"}));
  EXPECT_EQ(scene.output.checkpoint_every, 60);
  EXPECT_TRUE(scene.render.pictures);
  EXPECT_EQ(scene.render.count, 4);
  EXPECT_EQ(scene.render.width, 640);
  EXPECT_EQ(scene.render.height, 480);
  expect_vector(scene.render.view, {0, 1, 0});
  expect_vector(scene.render.up, {1, 0, 0});
}

TEST(Scene, UpIsAgainstGravityAndTheViewTurnsWithIt) {
  const auto render = [](const std::string& keys) {
    return parse_render(keys +
                            "\n[time]\nend = 1\n[[body]]\ncloud = \"c\"\n"
                            "material = { young = 1, poisson = 0.3, density = 1 }\n",
                        "scene.toml");
  };
  expect_vector(render("").up, {0, 0, 1});
  expect_vector(render("").view, {-1, 2, -0.6});
  expect_vector(render("gravity = [0, 0, -9.81]").view, {-1, 2, -0.6});
  // z becomes y, so y becomes -z.
  expect_vector(render("gravity = [0, -2, 0]").up, {0, 1, 0});
  expect_vector(render("gravity = [0, -2, 0]").view, {-1, -0.6, -2});
  expect_vector(render("gravity = [0, 0, 3]").up, {0, 0, -1});
  expect_vector(render("gravity = [0, 0, 3]").view, {-1, -2, 0.6});
  // What is said counts.
  expect_vector(render("gravity = [0, -2, 0]\n[render]\nup = [1, 0, 0]").up, {1, 0, 0});
  expect_vector(render("gravity = [0, -2, 0]\n[render]\nview = [0, 0, -1]").view, {0, 0, -1});
  expect_vector(render("gravity = [0, -2, 0]\n[render]\nview = [0, 0, -1]").up, {0, 1, 0});
  // A view along gravity, as there are in scenes from before, has the z that was up then.
  expect_vector(render("gravity = [0, -2, 0]\n[render]\nview = [0, -1, 0]").up, {0, 0, 1});
}

TEST(Scene, CamerasLookFromTheirPositionToTheirTarget) {
  const std::string text = R"(
[render.camera]
position = [4, 0, 1]
target = [1, 0, 1]
field_of_view = 45
orbit = -90
follow = "c"
[time]
end = 1
[[body]]
cloud = "c"
material = { young = 1, poisson = 0.3, density = 1 }
)";
  const CameraRequest camera = parse_camera(text, "scene.toml");
  expect_vector(*camera.position, {4, 0, 1});
  expect_vector(*camera.target, {1, 0, 1});
  EXPECT_EQ(camera.field_of_view, 45);
  EXPECT_EQ(camera.orbit, -90);
  EXPECT_EQ(camera.follow, "c");
  expect_vector(parse_render(text, "scene.toml").view, {-3, 0, 0});
  const std::string none = text.substr(text.find("[time]"));
  EXPECT_FALSE(parse_camera(none, "scene.toml").position);
}

TEST(Scene, BodyKeysAreReadExactly) {
  const Scene scene = parse_scene(full_scene, "folder/all.toml");
  ASSERT_EQ(scene.bodies.size(), 1u);
  const BodyRequest& body = scene.bodies[0];
  EXPECT_EQ(body.name, "bar");
  EXPECT_EQ(body.where, "folder/all.toml:24:1");
  EXPECT_EQ(body.source.shape.name, "block");
  expect_vector(body.source.shape.size, {1, 2, 3});
  EXPECT_EQ(body.source.shape.spacing, 0.25);
  EXPECT_EQ(body.source.shape.placement, ShapeRequest::Placement::nodes);
  EXPECT_EQ(body.source.shape.jitter, 0.1);
  EXPECT_EQ(body.source.seed, 7u);
  EXPECT_EQ(body.source.shape.seed, 7u);
  EXPECT_FALSE(body.source.shape.surface);
  EXPECT_TRUE(body.source.mesh.empty());
  EXPECT_TRUE(body.source.file.empty());
  EXPECT_EQ(body.scale, 2);
  expect_vector(body.rotation, {0, 0, 90});
  expect_vector(body.translation, {1, 2, 3});
  expect_vector(body.velocity, {4, 5, 6});
  expect_vector(body.spin, {7, 8, 9});
  EXPECT_EQ(body.volume_rule, VolumeRule::kernel);
  EXPECT_EQ(body.closure, 0.25);
  EXPECT_EQ(body.material.young, 2e5);
  EXPECT_EQ(body.material.poisson, -0.25);
  EXPECT_EQ(body.material.density, 1234);
  EXPECT_EQ(body.material.law, "small-strain");
  EXPECT_EQ(body.material.volume_stiffness, 5e4);
  EXPECT_EQ(body.material.damping, 0.125);
  EXPECT_EQ(body.material.hourglass, 0.0625);
  EXPECT_EQ(body.neighbourhood.support, NeighbourhoodRule::Support::adaptive);
  EXPECT_EQ(body.neighbourhood.nearest, 12);
  EXPECT_EQ(body.neighbourhood.factor, 3);
  EXPECT_FALSE(body.neighbourhood.radius.has_value());
  EXPECT_EQ(body.neighbourhood.max_neighbours, 20);
}

TEST(Scene, BoundaryKeysAreReadExactly) {
  const BodyRequest body = parse_scene(full_scene, "all.toml").bodies.at(0);
  ASSERT_EQ(body.fixed.size(), 2u);
  EXPECT_EQ(body.fixed[0].select.region, "x-");
  EXPECT_EQ(body.fixed[0].select.where, "all.toml:54:10");
  EXPECT_EQ(body.fixed[1].select.indices, (std::vector<Index>{5, 3}));
  ASSERT_EQ(body.motions.size(), 1u);
  const MotionRequest& motion = body.motions[0];
  ASSERT_TRUE(motion.select.box.has_value());
  expect_vector(motion.select.box->low, {0, 1, 2});
  expect_vector(motion.select.box->high, {3, 4, 5});
  expect_vector(motion.displacement, {0.1, 0.2, 0.3});
  EXPECT_EQ(motion.duration, 0.5);
  expect_vector(motion.velocity, {1, 2, 3});
  expect_vector(motion.amplitude, {4, 5, 6});
  EXPECT_EQ(motion.frequency, 7);
  ASSERT_EQ(body.loads.size(), 2u);
  ASSERT_TRUE(body.loads[0].select.ball.has_value());
  expect_vector(body.loads[0].select.ball->centre, {1, 2, 3});
  EXPECT_EQ(body.loads[0].select.ball->radius, 0.5);
  expect_vector(body.loads[0].force, {10, 20, 30});
  EXPECT_EQ(body.loads[0].ramp, 0.75);
  EXPECT_TRUE(body.loads[0].curve.empty());
  EXPECT_EQ(body.loads[1].curve, (std::vector<LoadCurve::Point>{{0.5, -1}, {2, 1.5}}));
  EXPECT_TRUE(body.loads[1].select.all);
  expect_vector(body.loads[1].force_density, {1, 2, 3});
}

TEST(Scene, KeysThatExcludeTheOthersAreReadToo) {
  const Scene scene = parse_scene(
      "[time]\nend = 1\nstep = 1e-4\n[[body]]\nshape = 'cylinder'\nradius = 0.5\n"
      "length = 2\nphyxels = 1000\n" +
          material + "[body.neighbours]\nradius = 0.25\n",
      "scene.toml");
  EXPECT_EQ(scene.time.step, 1e-4);
  EXPECT_EQ(scene.bodies[0].source.shape.radius, 0.5);
  EXPECT_EQ(scene.bodies[0].source.shape.length, 2);
  EXPECT_EQ(scene.bodies[0].source.phyxels, 1000);
  EXPECT_EQ(scene.bodies[0].neighbourhood.radius, 0.25);
}

TEST(Scene, LeavesOutMeansTheDefaultsOfTheTypes) {
  const Scene scene = parse_scene(time_section + dino, "scene.toml");
  EXPECT_EQ(scene.title, "");
  expect_vector(scene.gravity, {0, 0, 0});
  EXPECT_FALSE(scene.time.step.has_value());
  EXPECT_EQ(scene.time.safety, 0.8);
  EXPECT_EQ(scene.solver.device, "auto");
  EXPECT_EQ(scene.solver.precision, Precision::single);
  EXPECT_EQ(scene.output.frames_per_second, 25);
  EXPECT_FALSE(scene.render.pictures);
  ASSERT_EQ(scene.bodies.size(), 1u);
  EXPECT_EQ(scene.bodies[0].name, "dino");
  EXPECT_EQ(scene.bodies[0].scale, 1);
  EXPECT_EQ(scene.bodies[0].volume_rule, VolumeRule::automatic);
  EXPECT_EQ(scene.bodies[0].material.law, "st-venant-kirchhoff");
  EXPECT_EQ(scene.bodies[0].neighbourhood.factor, 1.8);
  EXPECT_TRUE(scene.bodies[0].fixed.empty());
}

/// What docs/accuracy.md shows to be most accurate for the time; the paper's bodies are as there.
TEST(Scene, WhatIsLeftOutIsWhatIsMostAccurate) {
  const auto body = [](const std::string& keys, const std::string& rest = "") {
    return parse_scene("[time]\nend = 1\n[[body]]\n" + keys +
                           "\n[body.material]\nyoung = 1\npoisson = 0.3\ndensity = 1\n" + rest,
                       "a.toml")
        .bodies[0];
  };
  const std::string beam = "shape = \"beam\"\nsize = [1, 0.1, 0.2]\n";
  using Placement = ShapeRequest::Placement;
  EXPECT_EQ(body(beam + "spacing = 0.05").source.shape.placement, Placement::nodes);
  EXPECT_EQ(body(beam + "spacing = 0.1").source.shape.placement, Placement::nodes);
  EXPECT_EQ(body(beam + "spacing = 0.11").source.shape.placement, Placement::cells);
  EXPECT_EQ(body(beam + "phyxels = 1000").source.shape.placement, Placement::nodes);
  EXPECT_EQ(body(beam + "phyxels = 3").source.shape.placement, Placement::cells);
  EXPECT_EQ(body(beam + "spacing = 0.05\nvolumes = \"kernel\"").source.shape.placement,
            Placement::cells);
  EXPECT_EQ(body(beam + "spacing = 0.05\nlattice = \"cells\"").source.shape.placement,
            Placement::cells);
  for (const std::string round :
       {"shape = \"sphere\"\nradius = 1\n", "shape = \"cylinder\"\nradius = 1\nlength = 2\n"}) {
    const auto placement = [&](const std::string& keys) {
      return body(round + keys).source.shape.placement;
    };
    const bool sphere = round.find("sphere") != round.npos;
    const auto lattice = sphere ? Placement::cells : Placement::nodes;
    EXPECT_EQ(placement("spacing = 0.1"), Placement::fitted);
    EXPECT_EQ(placement("phyxels = 5000"), Placement::fitted);
    EXPECT_EQ(placement("spacing = 0.7"), lattice);  // too few
    EXPECT_EQ(placement("spacing = 0.1\njitter = 0.1"), lattice);
    EXPECT_EQ(placement("spacing = 0.1\nsurfels = false"), lattice);
    EXPECT_EQ(placement("spacing = 0.1\nclosure = 0"), lattice);
    EXPECT_EQ(placement("spacing = 0.1\nvolumes = \"kernel\""), Placement::cells);
    EXPECT_EQ(placement("spacing = 0.1\n[body.neighbours]\nsupport = \"adaptive\""), lattice);
  }
  // Supports that end across the layers of a lattice.
  const auto held = [&](const std::string& keys, const std::string& support) {
    return body(beam + "spacing = 0.02\n" + keys, "[[body.fixed]]\n" + support + "\n")
        .source.shape.placement;
  };
  const std::string box = "box = [[-9, -9, -9], [0.33, 9, 9]]",
                    ball = "ball = { centre = [0, 0, 0], radius = 0.33 }";
  EXPECT_EQ(held("", box), Placement::nodes);
  EXPECT_EQ(held("rotation = [0, 0, 90]", box), Placement::nodes);
  EXPECT_EQ(held("rotation = [0, 0, 45]", box), Placement::fitted);
  EXPECT_EQ(held("", ball), Placement::fitted);
  EXPECT_EQ(held("closure = 0", ball), Placement::nodes);
  EXPECT_EQ(held("lattice = \"nodes\"", ball), Placement::nodes);
  EXPECT_EQ(held("", box + "\n[body.grading]"), Placement::fitted);

  EXPECT_EQ(body(beam + "spacing = 0.05").material.hourglass, 0.1);
  EXPECT_EQ(body(beam + "spacing = 0.05", "hourglass = 0").material.hourglass, 0);
  EXPECT_EQ(
      body(beam + "spacing = 0.05", "[body.neighbours]\nsupport = \"adaptive\"").material.hourglass,
      0);
  EXPECT_EQ(body("shape = \"dino\"").material.hourglass, 0);
  EXPECT_EQ(body(beam + "spacing = 0.05").source.on_surface, std::nullopt);
}

TEST(Scene, ArrayMakesNamedAndMovedCopies) {
  const Scene scene = parse_scene(
      time_section + "[[body]]\nname = 'd'\nshape = 'dino'\ntranslation = [1, 0, 0]\n" + material +
          "[body.array]\ncount = [2, 1, 2]\nspacing = [3, 0, -5]\n"
          "[[body.fixed]]\nball = {centre = [0, 1, 0], radius = 2}\n"
          "[[body.load]]\nbox = [[0, 0, 0], [1, 1, 1]]\nforce = [0, 0, 1]\n",
      "scene.toml");
  ASSERT_EQ(scene.bodies.size(), 4u);
  const Vec3d moved[] = {{0, 0, 0}, {3, 0, 0}, {0, 0, -5}, {3, 0, -5}};
  for (std::size_t b = 0; b < 4; ++b) {
    const BodyRequest& body = scene.bodies[b];
    EXPECT_EQ(body.name, "d " + std::to_string(b + 1));
    expect_vector(body.translation, Vec3d{1, 0, 0} + moved[b]);
    expect_vector(body.fixed.at(0).select.ball->centre, Vec3d{0, 1, 0} + moved[b]);
    expect_vector(body.loads.at(0).select.box->low, moved[b]);
    expect_vector(body.loads.at(0).select.box->high, Vec3d{1, 1, 1} + moved[b]);
    EXPECT_EQ(body.material.young, 1e5);
  }
}

TEST(Scene, ArrayMovesAxesOfMotionsAndInclusionsAlong) {
  const Scene scene = parse_scene(
      time_section + beam + material +
          "[body.array]\ncount = [1, 3, 1]\nspacing = [0, 4, 0]\n"
          "[[body.inclusion]]\nbox = [[0, -1, -1], [0.35, 1, 1]]\nyoung = 2e5\n"
          "[[body.inclusion]]\nball = {centre = [1, 0, 0], radius = 0.23}\ndensity = 2000\n"
          "[[body.motion]]\nbox = [[0.85, -1, -1], [1, 1, 1]]\nrotation = [90, 0, 0]\n"
          "about = [0, 0.25, 0.5]\nduration = 1\n",
      "scene.toml");
  ASSERT_EQ(scene.bodies.size(), 3u);
  for (std::size_t b = 0; b < 3; ++b) {
    const BodyRequest& body = scene.bodies[b];
    const Vec3d by{0, 4.0 * static_cast<double>(b), 0};
    expect_vector(body.motions.at(0).about, Vec3d{0, 0.25, 0.5} + by);
    expect_vector(body.motions.at(0).select.box->low, Vec3d{0.85, -1, -1} + by);
    expect_vector(body.inclusions.at(0).select.box->low, Vec3d{0, -1, -1} + by);
    expect_vector(body.inclusions.at(0).select.box->high, Vec3d{0.35, 1, 1} + by);
    expect_vector(body.inclusions.at(1).select.ball->centre, Vec3d{1, 0, 0} + by);
  }
  // And so the same phyxels of each copy are of the same material, and turn about the same line.
  const Model model = build_model(scene);
  ASSERT_EQ(model.parts.size(), 9u);
  for (std::size_t p = 3; p < 9; ++p) {
    EXPECT_EQ(model.parts[p].size, model.parts[p - 3].size);
    EXPECT_NEAR(model.parts[p].mass, model.parts[p - 3].mass, 1e-9);
  }
  for (std::size_t m = 1; m < 3; ++m) {
    const Motion &first = model.motions[0], &copy = model.motions[m];
    ASSERT_EQ(copy.phyxels.size(), first.phyxels.size());
    for (std::size_t k = 0; k < copy.phyxels.size(); ++k) {
      const Vec3d one = first.path_at(1).at(model.position[first.phyxels[k]]);
      const Vec3d other = copy.path_at(1).at(model.position[copy.phyxels[k]]);
      EXPECT_NEAR(norm(one - other), 0, 1e-12);  // rounding of places 8 m off
    }
  }
}

TEST(Scene, InclusionsSayAllThatTheyDifferIn) {
  const Scene scene = parse_scene(
      time_section + beam + material + "damping = 2\nvolume_stiffness = 100\n" +
          "[[body.inclusion]]\nregion = 'x-'\n"
          "[[body.inclusion]]\nregion = 'x+'\nyoung = 3e5\npoisson = 0.1\ndensity = 500\n"
          "law = 'corotated'\nvolume_stiffness = 200\ndamping = 7\n",
      "scene.toml");
  EXPECT_TRUE(scene.bodies[0].inclusions.at(0).material == scene.bodies[0].material);
  const Material& m = scene.bodies[0].inclusions.at(1).material;
  EXPECT_EQ(m.young, 3e5);
  EXPECT_EQ(m.poisson, 0.1);
  EXPECT_EQ(m.density, 500);
  EXPECT_EQ(m.law, "corotated");
  EXPECT_EQ(m.volume_stiffness, 200);
  EXPECT_EQ(m.damping, 7);
}

TEST_F(SceneFiles, PathsStartAtTheSceneFile) {
  const fs::path mesh = write("meshes/a.obj"), body = write("deep/b.h5");
  const fs::path file = write(
      "deep/s.toml", time_section + "[output]\ndirectory = '../results'\n" +
                         "[[body]]\nmesh = '../meshes/a.obj'\nphyxels = 9\n" + material +
                         "[[body]]\nfile = 'b.h5'\n" + material +
                         "[[body]]\nname = 'third'\nfile = '" + body.string() + "'\n" + material);
  const Scene scene = read_scene(file);
  EXPECT_EQ(scene.bodies[0].source.mesh, mesh);
  EXPECT_EQ(scene.bodies[0].name, "a");
  EXPECT_EQ(scene.bodies[0].source.phyxels, 9);
  EXPECT_EQ(scene.bodies[1].source.file, body);
  EXPECT_EQ(scene.bodies[1].name, "b");
  EXPECT_EQ(scene.bodies[2].source.file, body);
  EXPECT_EQ(scene.output.directory, folder_ / "results");
}

TEST(Scene, ABodyMayBeAProgramsOwnCloud) {
  const Scene scene = parse_scene(time_section + "[[body]]\ncloud = 'mine'\n" + material, "s.toml");
  EXPECT_EQ(scene.bodies.at(0).source.cloud, "mine");
  EXPECT_EQ(scene.bodies.at(0).name, "mine");
  ShapeRequest shape;
  shape.name = "block";
  shape.size = {1, 1, 1};
  shape.spacing = 0.25;
  const Cloud cloud = make_shape(shape);
  const std::vector<Cloud> clouds = make_clouds(scene, {{"mine", cloud}});
  EXPECT_TRUE(clouds.at(0).position == cloud.position);
  EXPECT_EQ(build_model(scene, clouds).size(), static_cast<Index>(cloud.position.size()));
  const auto refusal = [&](auto&& attempt) -> std::string {
    try {
      attempt();
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(refusal([&] {
              make_clouds(scene, {{"mines", cloud}});
            }),
            "s.toml:3:1: key body.cloud: \"mine\" found (did you mean \"mines\"?); allowed: mines");
  EXPECT_EQ(
      refusal([&] { build_model(scene); }),
      "s.toml:3:1: key body.cloud: \"mine\" found; allowed: shape, mesh or file, as no clouds "
      "were passed");
  EXPECT_THROW(parse_scene(time_section + "[[body]]\ncloud = 'a'\nphyxels = 9\n" + material, ""),
               InputError);
}

TEST(Scene, OutputGoesToAFolderNamedAfterTheSceneHere) {
  const auto directory = [](const fs::path& file) {
    return parse_scene(time_section + dino, file).output.directory;
  };
  EXPECT_EQ(directory("some/where/swing.toml"), "out/swing");
  EXPECT_EQ(directory("examples/dino/scene.toml"), "out/dino");
  EXPECT_EQ(directory("scene.toml"), "out" / fs::current_path().filename());
  EXPECT_EQ(directory(""), "out/scene");
}

TEST(Scene, EveryExampleIsRead) {
  const std::map<std::string, std::size_t> bodies{{"ten_dinos", 10},   {"bin_of_dinos", 6},
                                                  {"stack", 4},        {"cradle", 5},
                                                  {"rubber_rings", 2}, {"skittles", 11}};
  std::size_t count = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(PHYXEL_SOURCE_DIR "/examples")) {
    const fs::path file = entry.path() / "scene.toml";
    if (!fs::exists(file)) continue;
    ++count;
    const Scene scene = read_scene(file);
    EXPECT_FALSE(scene.title.empty()) << file;
    EXPECT_EQ(scene.output.directory, "out" / entry.path().filename()) << file;
    const auto some = bodies.find(entry.path().filename().string());
    EXPECT_EQ(scene.bodies.size(), some == bodies.end() ? 1 : some->second) << file;
  }
  EXPECT_GE(count, 9u);
}

}  // namespace
}  // namespace phyxel
