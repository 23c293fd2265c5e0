#include "view/live_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>

#include "drawn_obstacles.hpp"
#include "phyxel/law_table.hpp"
#include "report/opening_view.hpp"
#include "report/page.hpp"
#include "report/replay_obstacles.hpp"
#include "rigid_paths.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

using Json = nlohmann::ordered_json;

/// Points in units of the radius of an extent, about its centre.
std::vector<float> scaled(const std::vector<Vec3d>& points, const Extent& extent) {
  std::vector<float> numbers;
  for (const Vec3d p : points) {
    const Vec3d centred = (1 / extent.radius) * (p - extent.centre());
    for (int axis = 0; axis < 3; ++axis) {
      numbers.push_back(static_cast<float>(component(centred, axis)));
    }
  }
  return numbers;
}

/// The camera that the scene asks for.
CameraWishes wishes_of(const Scene& scene) { return camera_wishes(scene.text, scene.file); }

/// The obstacles that are drawn: those of the scene, or else a floor below its bodies.
std::vector<Obstacle> drawn(const LiveScene& live, const Instance& rest, const Extent& extent,
                            bool& floor) {
  const CameraWishes look = wishes_of(live.scene());
  floor = live.model().obstacles.empty() && looks_down(look.view, look.up);
  if (!floor) return live.model().obstacles;
  // The bodies have room to fall a little.
  return {floor_under({rest}, extent, look.up, extent.radius / 2)};
}

/// The sliders that the scene has a use for, with their values.
Json settings_of(const Scene& scene) {
  Json settings;
  settings["gravity"] = {scene.gravity.x, scene.gravity.y, scene.gravity.z};
  const bool elastic = std::any_of(scene.bodies.begin(), scene.bodies.end(), [](const auto& body) {
    return has_parameter(law_of(body, body.material), "young");
  });
  if (elastic) settings["stiffness"] = 1;
  settings["damping"] = scene.bodies.empty() ? 0 : scene.bodies.front().material.damping;
  if (scene.contact || !scene.obstacles.empty()) {
    double friction = scene.contact ? scene.contact->friction : 0;
    for (const ObstacleRequest& obstacle : scene.obstacles) {
      friction = std::max(friction, obstacle.friction);
    }
    settings["friction"] = friction;
  }
  return settings;
}

/// The data that the page's script reads. Lengths are in units of the radius, about the centre.
Json data_of(const LiveScene& live, const LivePicture& picture, const Instance& rest,
             const Extent& extent, const std::vector<Obstacle>& obstacles, bool floor) {
  Json data = opening_view(wishes_of(live.scene()), {rest}, extent, {});
  data["surfels"] = picture.surfels().size();
  data["phyxels"] = picture.phyxels().size();
  data["fields"] = Json::array();
  for (const LiveField& field : picture.fields()) {
    data["fields"].push_back({{"name", field.name}, {"unit", field.unit}});
  }
  data["opening"] = {{"frame", 0}, {"field", -1}};
  const double start[] = {0};
  data["obstacles"] = obstacles_json(obstacles, RigidPaths(), start, extent);
  data["only_floor"] = floor;
  data["spacing"] = picture.spacing() / extent.radius;
  data["reach"] = carrier_reach(picture.spacing()) / extent.radius;
  data["carriers"] = Carriers::each;
  data["settings"] = settings_of(live.scene());
  data["step"] = live.solver().dt();
  const Scene& scene = live.scene();
  data["frame"] = scene.output.frames_per_second > 0 ? 1 / scene.output.frames_per_second
                                                     : scene.time.end / 100;
  return data;
}

}  // namespace

std::string live_page(const LiveScene& live, const LivePicture& picture, const std::string& about) {
  Instance rest;
  rest.surfels = picture.surfels();
  rest.phyxels = picture.phyxels();
  const Extent extent = extent_of({rest});
  bool floor = false;
  const std::vector<Obstacle> obstacles = drawn(live, rest, extent, floor);
  std::string elements;
  const auto embed = [&](const std::string& name, const auto& numbers) {
    elements += byte_element(name, std::as_bytes(std::span(numbers)));
  };
  embed("rest-phyxels", scaled(rest.phyxels, extent));
  embed("phyxels-bodies", picture.phyxel_bodies());
  embed("ids", picture.ids());
  if (!rest.surfels.empty()) {
    embed("rest-surfels", scaled(rest.surfels, extent));
    embed("surfels-bodies", picture.surfel_bodies());
    embed("triangles", picture.triangles());
    embed("carriers", picture.carriers().phyxel);
    embed("weights", picture.carriers().weight);
  }
  elements += obstacle_elements(obstacles, extent);
  std::string title = live.scene().title;
  if (title.empty()) title = live.scene().file.stem().string();
  if (title.empty()) title = "A simulation";
  const std::string summary = fmt::format(
      "{} phyxels, {} surfels, {}",
      with_separators(static_cast<std::size_t>(live.model().global_count())),
      with_separators(static_cast<std::size_t>(live.model().global_surfel_count())), about);
  return filled_page("view.html",
                     {{"title", html_text(title)},
                      {"summary", html_text(summary)},
                      {"elements", elements},
                      {"data", script_json(data_of(live, picture, rest, extent, obstacles, floor))},
                      {"scene", html_text(live.scene().text)},
                      {"footer", html_text(fmt::format("Simulated by {}.", program_version()))}});
}

}  // namespace phyxel::app
