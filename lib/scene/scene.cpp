#include "phyxel/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>

#include "files/atomic_file.hpp"
#include "phyxel/camera_request.hpp"
#include "phyxel/error.hpp"
#include "scene/parse_obstacles.hpp"
#include "scene/scene_body.hpp"
#include "scene/scene_contact.hpp"
#include "scene/scene_error.hpp"
#include "scene/scene_obstacles.hpp"
#include "scene/scene_probes.hpp"
#include "scene/scene_table.hpp"
#include "scene/upright.hpp"

namespace phyxel {
namespace {

TimeRequest read_time(const SceneTable& table) {
  TimeRequest time;
  table.read("end", time.end);
  if (table.is_number("step")) {
    table.read("step", time.step);
    table.expect_apart("safety", "step");
  }
  table.read("safety", time.safety);
  return time;
}

SolverRequest read_solver(const SceneTable& table) {
  SolverRequest solver;
  table.read_choice("method", solver.method);
  if (solver.method != Method::verlet) solver.precision = Precision::double_;
  table.read("device", solver.device);
  table.read_choice("precision", solver.precision);
  if (solver.method != Method::verlet && solver.precision != Precision::double_) {
    table.refuse("precision",
                 fmt::format("\"{}\" found; allowed with method = \"{}\": \"double\"",
                             precision_name(solver.precision), method_name(solver.method)));
  }
  table.read("threads", solver.threads);
  return solver;
}

std::filesystem::path default_directory(const std::filesystem::path& file) {
  std::filesystem::path name = file.stem();
  if (file.filename() == "scene.toml") {
    std::error_code ignored;
    name = std::filesystem::absolute(file, ignored).lexically_normal().parent_path().filename();
  }
  return std::filesystem::path("out") / (name.empty() ? "scene" : name);
}

OutputRequest read_output(const SceneTable& table) {
  OutputRequest output;
  table.read("directory", output.directory);
  table.read("frames_per_second", output.frames_per_second);
  table.read("phyxels", output.phyxels);
  table.read("surface", output.surface);
  table.read("fields", output.fields);
  table.read("recovery", output.recovery);
  table.read("checkpoint_every", output.checkpoint_every);
  return output;
}

/// Scaled to a largest component of 1, so that no product of two overflows.
Vec3d scaled(Vec3d v) {
  return v / std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z), 1e-300});
}

/// `view` in axes whose last is up.
Vec3d turned(Vec3d view, Vec3d up) {
  const auto [x, y, z] = upright_axes(up);
  return view.x * x + view.y * y + view.z * z;
}

bool are_parallel(Vec3d a, Vec3d b) { return norm(cross(a, b)) < 1e-6 * norm(a) * norm(b); }

/// Pictures of a scene that says nothing of them: against gravity is up.
RenderRequest default_render(Vec3d gravity) {
  RenderRequest render;
  const Vec3d down = scaled(gravity);
  if (!(norm(down) < 0.5)) render.up = normalised(-down);
  render.view = turned(render.view, render.up);
  return render;
}

/// Reads the camera in a scene's table of pictures.
CameraRequest read_camera(const SceneTable& render) {
  CameraRequest camera;
  if (!render.has("camera")) return camera;
  const SceneTable table = render.table("camera");
  table.read("position", camera.position);
  table.read("target", camera.target);
  table.read("field_of_view", camera.field_of_view);
  table.read("orbit", camera.orbit);
  table.read("follow", camera.follow);
  if (!camera.position || !camera.target) return camera;
  if (render.has("view")) {
    render.refuse("view",
                  "found beside camera.position and camera.target, which are a direction of view; "
                  "allowed: with one of them at most");
  }
  if (!(norm(*camera.target - *camera.position) > 0)) {
    table.refuse("target", "the place of the camera found; allowed: another point");
  }
  return camera;
}

RenderRequest read_render(const SceneTable& table, Vec3d gravity) {
  RenderRequest render = default_render(gravity);
  table.read("pictures", render.pictures);
  table.read("count", render.count);
  table.read("width", render.width);
  table.read("height", render.height);
  table.read("view", render.view);
  table.read("up", render.up);
  const auto words = [](Vec3d v) { return fmt::format("[{:g}, {:g}, {:g}]", v.x, v.y, v.z); };
  if (table.has("up") && !table.has("view") && !(norm(scaled(render.up)) < 0.5)) {
    render.view = turned(RenderRequest{}.view, scaled(render.up));
  }
  const CameraRequest camera = read_camera(table);
  if (camera.position && camera.target) render.view = *camera.target - *camera.position;
  if (!table.has("up") && are_parallel(scaled(render.view), render.up)) {
    render.up = RenderRequest{}.up;
  }
  const Vec3d view = scaled(render.view), up = scaled(render.up);
  if (norm(view) < 0.5) table.refuse("view", words(render.view) + " found; allowed: not zero");
  if (norm(up) < 0.5) table.refuse("up", words(render.up) + " found; allowed: not zero");
  if (are_parallel(view, up)) {
    table.refuse(table.has("view") ? "view"
                 : table.has("up") ? "up"
                                   : "camera",
                 fmt::format("view {} and up {} found, which are parallel; allowed: any two other "
                             "directions",
                             words(render.view), words(render.up)));
  }
  return render;
}

RenderRequest render_of(const SceneTable& root, Vec3d gravity) {
  return root.has("render") ? read_render(root.table("render"), gravity) : default_render(gravity);
}

/// Refuses a camera that follows what is neither a body nor a free rigid body of the scene.
void check_followed(const SceneTable& root, const Scene& scene) {
  if (!root.has("render")) return;
  const SceneTable render = root.table("render");
  const std::string followed = read_camera(render).follow;
  if (followed.empty()) return;
  std::string allowed = names_of(scene.bodies);
  bool known = std::any_of(scene.bodies.begin(), scene.bodies.end(),
                           [&](const BodyRequest& body) { return body.name == followed; });
  for (const ObstacleRequest& obstacle : scene.obstacles) {
    if (!obstacle.density) continue;
    known = known || obstacle.name == followed;
    allowed += ", " + in_quotes(obstacle.name);
  }
  if (known) return;
  render.table("camera").refuse(
      "follow",
      fmt::format("{} found, which no body is called; allowed: {}", in_quotes(followed), allowed));
}

std::vector<BodyRequest> read_bodies(const SceneTable& root) {
  std::vector<BodyRequest> bodies;
  std::map<std::string, std::string> places;  // of each name
  for (const SceneTable& table : root.tables("body")) {
    for (BodyRequest& body : body_requests(table)) {
      const auto [earlier, is_new] = places.emplace(body.name, body.where);
      if (!is_new) {
        table.refuse("name", fmt::format("{} found, the name of the body at {} too; allowed: a "
                                         "name of its own for each body",
                                         in_quotes(body.name), earlier->second));
      }
      if (bodies.size() == most_bodies) {
        throw InputError(
            fmt::format("{}: body: more than {} bodies found, copies included; "
                        "allowed: {}",
                        body.where, most_bodies, most_bodies));
      }
      bodies.push_back(std::move(body));
    }
  }
  return bodies;
}

std::string read_text(const std::filesystem::path& file) {
  require_regular_file(file, "a scene file (TOML)");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw InputError(
        fmt::format("{}: cannot read the scene file: {}", file.string(), std::strerror(errno)));
  }
  std::string text(largest_scene_file + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) {
    throw InputError(fmt::format("{}: reading the scene file failed", file.string()));
  }
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

}  // namespace

Scene parse_scene(const std::string& text, const std::filesystem::path& file) {
  const toml::table parsed = parse_toml(text, file);
  const SceneTable root(parsed, file);
  Scene scene;
  scene.file = file;
  scene.text = text;
  root.read("title", scene.title);
  root.read("gravity", scene.gravity);
  if (root.has("solver")) scene.solver = read_solver(root.table("solver"));
  if (root.has("time")) {
    scene.time = read_time(root.table("time"));
  } else if (scene.solver.method != Method::equilibrium) {
    root.refuse("time", "missing; needed: [time]");
  }
  if (root.has("output")) scene.output = read_output(root.table("output"));
  if (scene.output.directory.empty()) scene.output.directory = default_directory(file);
  scene.render = render_of(root, scene.gravity);
  scene.bodies = naming(scene, [&] { return read_bodies(root); });
  scene.obstacles = read_obstacles(root, FilesOf::run);
  if (root.has("contact")) scene.contact = read_contact(root.table("contact"), scene.bodies);
  check_penalties(scene);
  naming(scene, [&] { read_probes(root, scene.bodies); });
  check_followed(root, scene);
  return scene;
}

RenderRequest parse_render(const std::string& text, const std::filesystem::path& file) {
  const toml::table parsed = parse_toml(text, file);
  const SceneTable root(parsed, file);
  Vec3d gravity;
  root.read("gravity", gravity);
  return render_of(root, gravity);
}

CameraRequest parse_camera(const std::string& text, const std::filesystem::path& file) {
  const toml::table parsed = parse_toml(text, file);
  const SceneTable root(parsed, file);
  return root.has("render") ? read_camera(root.table("render")) : CameraRequest{};
}

Scene parse_obstacles(const std::string& text, const std::filesystem::path& file) {
  const toml::table parsed = parse_toml(text, file);
  const SceneTable root(parsed, file);
  Scene scene;
  if (root.has("solver")) scene.solver = read_solver(root.table("solver"));
  scene.obstacles = read_obstacles(root, FilesOf::picture);
  return scene;
}

bool OutputRequest::wants(std::string_view field) const {
  return std::find(fields.begin(), fields.end(), field) != fields.end();
}

Scene read_scene(const std::filesystem::path& file) { return parse_scene(read_text(file), file); }

const char* precision_name(Precision precision) {
  switch (precision) {
    case Precision::single:
      return "float";
    case Precision::double_:
      return "double";
    case Precision::mixed:
      break;
  }
  return "mixed";
}

const char* method_name(Method method) {
  switch (method) {
    case Method::verlet:
      return "verlet";
    case Method::implicit:
      return "implicit";
    case Method::equilibrium:
      break;
  }
  return "equilibrium";
}

std::optional<Method> method_named(std::string_view name) {
  for (const Method m : {Method::verlet, Method::implicit, Method::equilibrium}) {
    if (name == method_name(m)) return m;
  }
  return std::nullopt;
}

std::optional<Precision> precision_named(std::string_view name) {
  for (const Precision p : {Precision::single, Precision::double_, Precision::mixed}) {
    if (name == precision_name(p)) return p;
  }
  return std::nullopt;
}

}  // namespace phyxel
