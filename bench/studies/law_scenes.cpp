#include "law_scenes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "phyxel/mesh.hpp"

namespace phyxel::studies {
namespace {

constexpr double earth = 9.81;  // [m/s²]

/// Everything but the law and what happens to the body.
Scene scene_of(BodySource source, double young, double poisson) {
  Scene scene;
  scene.time.end = 2;
  BodyRequest body;
  body.name = "body";
  body.where = "phyxel_studies laws";
  body.source = std::move(source);
  body.material = {.young = young, .poisson = poisson, .density = 1000};
  scene.bodies.push_back(body);
  return scene;
}

Scene shape(const char* name, Vec3d size, double spacing, double young, double poisson = 0.3) {
  ShapeRequest request{.name = name, .size = size, .spacing = spacing, .surface = false};
  request.placement = name == std::string("block") ? ShapeRequest::Placement::nodes
                                                   : ShapeRequest::Placement::cells;
  if (request.placement == ShapeRequest::Placement::cells) {  // round ones
    request.radius = size.x;
    request.length = size.z;
    request.size = {};
  }
  return scene_of({.shape = request}, young, poisson);
}

Scene& under_gravity(Scene& scene) {
  scene.gravity = {0, 0, -earth};
  return scene;
}

Scene& held(Scene& scene, const char* region) {
  scene.bodies[0].fixed.push_back({.select = {.region = region}});
  return scene;
}

Scene& moved(Scene& scene, MotionRequest motion) {
  motion.select.region = "z+";
  motion.duration = 1;
  held(scene, "z-").bodies[0].motions.push_back(motion);
  return scene;
}

/// All below or above a height.
Selection slab(double low, double high) {
  return {.box = Selection::Box{{-1e3, -1e3, low}, {1e3, 1e3, high}}};
}

Vec3d flattened(Vec3d x) { return {-0.9 * x.x, 0, 0}; }
/// Inside out; waves of a thousandth, since no side is the right one of a mirror.
Vec3d mirrored(Vec3d x) {
  return {-2 * x.x + 1e-3 * std::sin(37 * x.y + 11 * x.z), 1e-3 * std::sin(29 * x.x + 5 * x.z),
          1e-3 * std::sin(31 * x.x + 17 * x.y)};
}

std::vector<FirstScene> scenes_of_shapes() {
  std::vector<FirstScene> all;
  const auto add = [&](const char* name, const char* what, const Scene& scene,
                       Vec3d (*start)(Vec3d) = nullptr) {
    all.push_back({name, what, scene, start});
  };
  const Vec3d cube{0.4, 0.4, 0.4}, column{0.2, 0.2, 0.8};
  Scene ball = shape("sphere", {0.3, 0, 0}, 0.06, 1e4);
  ball.bodies[0].fixed.push_back({.select = slab(-1, -0.22)});
  add("jelly ball", "A ball, 0.6 m across, E = 10⁴ Pa, stands with its lowest part fixed.",
      under_gravity(ball));
  Scene pillar = shape("cylinder", {0.1, 0, 0.8}, 0.04, 2e4, 0.45);
  pillar.bodies[0].fixed.push_back({.select = slab(-1, -0.36)});
  add("pillar", "A cylinder, 0.8 m high, 0.2 m across, E = 2·10⁴ Pa, buckles under its weight.",
      under_gravity(pillar));
  Scene beam = shape("block", {1, 0.2, 0.2}, 0.04, 3e4);
  add("soft beam",
      "A beam of 1 m by 0.2 m, E = 3·10⁴ Pa, clamped at one end, falls under its "
      "weight.",
      under_gravity(held(beam, "x-")));
  Scene hung = shape("block", column, 0.04, 3e4, 0.45);
  add("hung column",
      "A column of 0.8 m by 0.2 m, E = 3·10⁴ Pa, is released, hanging from its "
      "upper end.",
      under_gravity(held(hung, "z+")));
  Scene thin = shape("block", column, 0.04, 1e4, 0.45);
  add("hung jelly",
      "The same column with E = 10⁴ Pa, whose weight stretches it to more than twice its length.",
      under_gravity(held(thin, "z+")));
  Scene dropped = shape("block", cube, 0.05, 3e4);
  dropped.bodies[0].velocity = {0, 0, -4};
  add("dropped cube", "A cube of 0.4 m, E = 3·10⁴ Pa, hits the ground at 4 m/s and sticks.",
      under_gravity(held(dropped, "z-")));
  Scene pressed = shape("block", cube, 0.05, 1e5);
  add("pressed cube", "A cube, E = 10⁵ Pa, is compressed to 30% of its height within a second.",
      moved(pressed, {.displacement = {0, 0, -0.28}}));
  Scene pulled = shape("block", cube, 0.05, 1e5);
  add("pulled cube", "A cube is stretched to twice its height within a second.",
      moved(pulled, {.displacement = {0, 0, 0.4}}));
  Scene sheared = shape("block", cube, 0.05, 1e5);
  add("sheared cube", "A cube is sheared by its height within a second.",
      moved(sheared, {.displacement = {0.4, 0, 0}}));
  Scene twisted = shape("block", column, 0.04, 1e5);
  add("twisted column", "A column is twisted by one turn within a second.",
      moved(twisted, {.rotation = {0, 0, 360}}));
  Scene thrown = shape("block", {0.6, 0.2, 0.2}, 0.04, 1e5);
  thrown.bodies[0].spin = {0, 0, 25};
  Scene sprung = shape("block", cube, 0.1, 1e6);
  sprung.bodies[0].material.damping = 30;
  add("flattened cube", "A free cube, E = 10⁶ Pa, damped, is released from a tenth of its length.",
      sprung, flattened);
  add("mirrored cube",
      "The same cube is released from its mirror image, with a small "
      "perturbation.",
      sprung, mirrored);
  add("spinning bar", "A free bar of 0.6 m, E = 10⁵ Pa, starts to spin at 25 rad/s.", thrown);
  return all;
}

void add_scenes_of_mesh(const std::filesystem::path& file, std::vector<FirstScene>& all) {
  const Surface mesh = read_mesh(file);
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const Vec3d& x : mesh.position) low = std::min(low, x.z), high = std::max(high, x.z);
  const double scale = 1 / (high - low), tenth = 0.1;
  const std::string name = file.stem().string();
  for (const bool stands : {true, false}) {
    for (const double young : {1e4, 3e4, 1e5}) {
      Scene scene = scene_of({.mesh = file, .phyxels = 1500}, young, 0.4);
      scene.bodies[0].scale = scale;
      scene.bodies[0].fixed.push_back(
          {.select = stands ? slab(low * scale - 1, low * scale + tenth)
                            : slab(high * scale - tenth, high * scale + 1)});
      all.push_back({fmt::format("{} {} at E = {:g}", name, stands ? "stands" : "hangs", young),
                     fmt::format("The mesh {}, 1 m high, E = {:g} Pa, {} a tenth of its height.",
                                 name, young, stands ? "stands on" : "hangs from"),
                     under_gravity(scene)});
    }
  }
}

}  // namespace

std::vector<FirstScene> first_scenes(const std::vector<std::filesystem::path>& meshes) {
  std::vector<FirstScene> all = scenes_of_shapes();
  for (const std::filesystem::path& mesh : meshes) add_scenes_of_mesh(mesh, all);
  return all;
}

}  // namespace phyxel::studies
