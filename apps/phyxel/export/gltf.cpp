#include "export/gltf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "compose.hpp"
#include "draw_obstacles.hpp"
#include "export/obstacle_mesh.hpp"
#include "frame_scene.hpp"
#include "phyxel/error.hpp"
#include "rigid_paths.hpp"
#include "scene/upright.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Json = GltfFile::Json;
using Floats = std::vector<Vec3<float>>;

Json json_of(Vec3d v) { return Json::array({v.x, v.y, v.z}); }

/// A matte material. @param colour in linear light, as glTF has it
Json material_of(const std::string& name, Colour colour, double roughness) {
  return {{"name", name},
          {"pbrMetallicRoughness",
           {{"baseColorFactor", Json::array({colour.x, colour.y, colour.z, 1})},
            {"metallicFactor", 0},
            {"roughnessFactor", roughness}}}};
}

/// The differences between the values of a frame and those of the first one.
Floats differences(const Floats& first, const std::vector<Vec3d>& values) {
  Floats found;
  for (std::size_t k = 0; k < values.size(); ++k) {
    found.push_back(to<float>(values[k] - to<double>(first[k])));
  }
  return found;
}

Floats as_floats(const std::vector<Vec3d>& values) {
  Floats floats;
  for (const Vec3d v : values) floats.push_back(to<float>(v));
  return floats;
}

/// The part of a surface that belongs to a body.
struct BodySurface {
  Index body = 0;
  std::vector<std::size_t> surfel;                     ///< Numbers in the frame.
  std::vector<std::array<std::uint32_t, 3>> triangle;  ///< Of positions in `surfel`.
  std::vector<std::size_t> number;                     ///< Numbers of the triangles in the frame.
  Vec3d origin;  ///< Of the coordinates of its vertices: the middle of its first frame [m].
  Floats position, normal, colour;         ///< Of the first frame; colours if a field is shown.
  Json attributes, targets, target_names;  ///< Accessors, and a name of each target.
};

/// The values of some surfels.
std::vector<Vec3d> some(const std::vector<Vec3d>& values, const std::vector<std::size_t>& surfel) {
  std::vector<Vec3d> found;
  for (const std::size_t k : surfel) found.push_back(values[k]);
  return found;
}

std::vector<BodySurface> split_by_body(const FrameData& frame) {
  std::vector<BodySurface> bodies;
  std::vector<std::uint32_t> place(frame.point.size());
  const auto body_at = [&](std::size_t k) -> BodySurface& {
    const Index body = frame.body.empty() ? 0 : frame.body[k];
    const auto found = std::find_if(bodies.rbegin(), bodies.rend(),
                                    [&](const BodySurface& b) { return b.body == body; });
    if (found != bodies.rend()) return *found;
    bodies.push_back({.body = body});
    return bodies.back();
  };
  for (std::size_t k = 0; k < frame.point.size(); ++k) {
    BodySurface& body = body_at(k);
    place[k] = static_cast<std::uint32_t>(body.surfel.size());
    body.surfel.push_back(k);
  }
  for (std::size_t t = 0; t < frame.triangle.size(); ++t) {
    const Triangle& corners = frame.triangle[t];
    std::array<std::uint32_t, 3> triangle;
    for (std::size_t c = 0; c < 3; ++c) triangle[c] = place[static_cast<std::size_t>(corners[c])];
    BodySurface& body = body_at(static_cast<std::size_t>(corners[0]));
    body.triangle.push_back(triangle);
    body.number.push_back(t);
  }
  std::erase_if(bodies, [](const BodySurface& body) { return body.triangle.empty(); });
  return bodies;
}

/// The middle of the box of some points [m], and half its diagonal [m].
std::pair<Vec3d, double> middle_of(const std::vector<Vec3d>& points) {
  Span box[3];
  for (const Vec3d p : points) {
    for (int axis = 0; axis < 3; ++axis) box[axis].include(component(p, axis));
  }
  const Vec3d low{box[0].low, box[1].low, box[2].low}, high{box[0].high, box[1].high, box[2].high};
  return {0.5 * (low + high), 0.5 * norm(high - low)};
}

/// The animation of a run: the times of its frames, and channels that change nodes.
class Animation {
 public:
  Animation(GltfFile& file, const std::vector<float>& times) : file_(file), frames_(times.size()) {
    if (frames_ > 1) times_ = file.add_times(times);
  }

  /// Animates the weights of a node's morph targets, one for each frame but the first.
  void add_weights(std::size_t node) {
    if (frames_ < 2) return;
    if (!weights_) {
      std::vector<float> weights(frames_ * (frames_ - 1));
      for (std::size_t k = 1; k < frames_; ++k) weights[k * (frames_ - 1) + k - 1] = 1;
      weights_ = add_sampler(file_.add_keyframes(weights, "SCALAR"));
    }
    add_channel(*weights_, node, "weights");
  }

  /// Animates the place of a node. @param steps place of an obstacle at each frame
  void add_places(std::size_t node, const std::vector<ObstacleStep>& steps) {
    std::vector<float> translations, rotations;
    std::array<double, 4> before{};
    for (const ObstacleStep& step : steps) {
      for (const double x : {step.place.x, step.place.y, step.place.z}) {
        translations.push_back(static_cast<float>(x));
      }
      std::array<double, 4> q = quaternion_of(step.turn);
      double product = 0;
      for (std::size_t k = 0; k < 4; ++k) product += q[k] * before[k];
      for (double& part : q) {  // the sign that lies nearer to the frame before
        if (product < 0) part = -part;
        rotations.push_back(static_cast<float>(part));
      }
      before = q;
    }
    add_channel(add_sampler(file_.add_keyframes(translations, "VEC3")), node, "translation");
    add_channel(add_sampler(file_.add_keyframes(rotations, "VEC4")), node, "rotation");
  }

  /// Lets a node vanish after a frame, by a scale of zero. @param last number of the frame
  void add_end(std::size_t node, std::size_t last) {
    std::vector<float> scales(3 * frames_, 0);
    std::fill_n(scales.begin(), 3 * (last + 1), 1.0F);
    add_channel(add_sampler(file_.add_keyframes(scales, "VEC3"), "STEP"), node, "scale");
  }

  /// Adds the animation to the file, if anything moves.
  void finish() {
    if (channels_.empty()) return;
    file_.add("animations", {{"name", "run"}, {"samplers", samplers_}, {"channels", channels_}});
  }

 private:
  std::size_t add_sampler(std::size_t output, const char* interpolation = "LINEAR") {
    samplers_.push_back({{"input", times_}, {"interpolation", interpolation}, {"output", output}});
    return samplers_.size() - 1;
  }
  void add_channel(std::size_t sampler, std::size_t node, const char* path) {
    channels_.push_back({{"sampler", sampler}, {"target", {{"node", node}, {"path", path}}}});
  }

  GltfFile& file_;
  std::size_t frames_, times_ = 0;
  std::optional<std::size_t> weights_;
  Json samplers_ = Json::array(), channels_ = Json::array();
};

/// A run on its way to a file.
class Exporter {
 public:
  explicit Exporter(const GltfRequest& request)
      : request_(request), shots_(find_trajectory(request.input, {}).shots) {
    if (shots_.front().surface.empty()) {
      throw InputError(fmt::format(
          "{}: holds phyxels only, and glTF has surfaces; allowed: a run that writes its surface",
          request.input.string()));
    }
    std::erase_if(shots_, [](const Shot& shot) { return shot.surface.empty(); });
    first_ = read_frame(shots_.front().surface, true);
    if (first_.triangle.empty()) {
      throw InputError(fmt::format("{}: has no triangles", shots_.front().surface.string()));
    }
    bodies_ = split_by_body(first_);
    last_.assign(first_.triangle.size(), never);
    obstacles_ = obstacles_of_frames(first_.scene, request.scene_folder);
    choose();
    if (!request.colours.field.empty()) {
      const auto phyxels = read_if_any(shots_.front().phyxels);
      colouring_ = field_colours(shots_, chosen_, request.colours,
                                 phyxels ? typical_spacing(phyxels->point) : 0);
    }
  }

  GltfExport made() {
    const std::vector<float> times = animation_times();
    for (std::size_t k = 0; k < chosen_.size(); ++k) add_frame(k);
    Animation animation(file_, times);
    add_nodes(animation);
    animation.finish();
    describe();
    return {file_.content(request_.container), chosen_.size(), std::move(notes_)};
  }

 private:
  /// Chooses the frames, and leaves some out if the file would be too large.
  void choose() {
    chosen_ = choose_frames(request_.choice, shots_.size());
    const auto vertices = static_cast<double>(first_.point.size());
    const double grown = request_.container == GltfContainer::json ? 4.0 / 3 : 1;
    const double of_frame = vertices * (request_.colours.field.empty() ? 24 : 36);
    double once = 5e3 + static_cast<double>(12 * first_.triangle.size() + first_.scene.size());
    for (const Obstacle& obstacle : obstacles_) {
      const Surface mesh = obstacle_mesh(obstacle, {}, 1);
      once += 1e3 + static_cast<double>(24 * mesh.position.size() + 12 * mesh.triangle.size());
    }
    // Weights are those of all targets at all frames; the JSON of a target takes up to 1 kB.
    const auto bytes = [&](std::size_t frames) {
      const auto n = static_cast<double>(frames);
      return grown * (once + n * of_frame + 4 * n * n) +
             1000 * n * static_cast<double>(bodies_.size());
    };
    std::size_t fit = chosen_.size();
    while (fit > 1 && bytes(fit) > 1e6 * request_.megabytes) fit -= 1 + fit / 1000;
    if (fit == chosen_.size()) return;
    if (fit < 2) {
      throw InputError(fmt::format(
          "{}: two frames take {:.3g} MB; allowed: a larger --max-megabytes, or --count 1",
          request_.input.string(), bytes(2) / 1e6));
    }
    std::vector<std::size_t> kept;
    const FrameChoice some{.count = static_cast<std::int64_t>(fit)};
    for (const std::size_t k : choose_frames(some, chosen_.size())) kept.push_back(chosen_[k]);
    notes_.push_back(fmt::format(
        "{} of {} frames are exported, evenly spaced: with all of them the file would be larger "
        "than {:g} MB (--max-megabytes).",
        fit, chosen_.size(), request_.megabytes));
    chosen_ = std::move(kept);
  }

  /// Times of the frames in the animation [s].
  std::vector<float> animation_times() const {
    const double begin = shots_[chosen_.front()].time, run = shots_[chosen_.back()].time - begin;
    const double scale = request_.seconds && run > 0 ? *request_.seconds / run : 1;
    std::vector<float> times;
    for (const std::size_t shot : chosen_) {
      times.push_back(static_cast<float>(scale * (shots_[shot].time - begin)));
      if (times.size() > 1 && !(times.back() > times[times.size() - 2])) {
        throw InputError(fmt::format(
            "{}: its time {:g} s is not after that of the frame before; allowed: frames at "
            "ascending times",
            shots_[shot].surface.string(), shots_[shot].time));
      }
    }
    return times;
  }

  /// Reads a chosen frame, and notes its triangles: those of the first frame, but for some that
  /// cracks have crossed since.
  FrameData read(std::size_t number) {
    const fs::path& file = shots_[chosen_[number]].surface;
    FrameData frame = read_frame(file, colouring_.has_value());
    std::size_t found = 0;
    for (std::size_t t = 0; t < last_.size() && found < frame.triangle.size(); ++t) {
      if (frame.triangle[found] != first_.triangle[t]) continue;
      last_[t] = number;
      ++found;
    }
    if (found < frame.triangle.size() || frame.point.size() != first_.point.size() ||
        frame.body != first_.body) {
      throw InputError(fmt::format(
          "{}: has other points or triangles than the first frame; allowed: frames that share "
          "them (--frames), --format vtu, or USD from Python",
          file.string()));
    }
    if (frame.normal.empty()) frame.normal = vertex_normals(frame.point, frame.triangle);
    for (Vec3d& normal : frame.normal) {  // of unit length, as glTF has them
      const double length = norm(normal);
      normal = length > 0 ? normal / length : Vec3d{0, 0, 1};
    }
    return frame;
  }

  std::vector<Vec3d> colours_of(const FrameData& surface, const fs::path& phyxels) const {
    const auto inside = read_if_any(phyxels, true);
    const std::vector<double> values =
        shown_values(&surface, inside ? &*inside : nullptr, *colouring_);
    std::vector<Vec3d> colours(surface.point.size(), to<double>(field_colour(0, *colouring_)));
    for (std::size_t k = 0; k < values.size(); ++k) {
      colours[k] = to<double>(field_colour(values[k], *colouring_));
    }
    return colours;
  }

  void add_frame(std::size_t number) {
    const FrameData frame = read(number);
    std::vector<Vec3d> colours;
    if (colouring_) colours = colours_of(frame, shots_[chosen_[number]].phyxels);
    for (BodySurface& body : bodies_) {
      std::vector<Vec3d> positions = some(frame.point, body.surfel);
      if (body.attributes.empty()) body.origin = to<double>(to<float>(middle_of(positions).first));
      for (Vec3d& x : positions) x = x - body.origin;
      Json attributes;
      const auto add = [&](const char* name, Floats& first, const std::vector<Vec3d>& values) {
        if (first.empty()) first = as_floats(values);
        const bool bounds = &first == &body.position;
        const bool base = body.attributes.empty();
        attributes[name] = file_.add_attribute(base ? first : differences(first, values), bounds);
      };
      add("POSITION", body.position, positions);
      add("NORMAL", body.normal, some(frame.normal, body.surfel));
      if (colouring_) add("COLOR_0", body.colour, some(colours, body.surfel));
      if (body.attributes.empty()) {
        body.attributes = std::move(attributes);
      } else {
        body.targets.push_back(std::move(attributes));
        body.target_names.push_back(fmt::format("t = {:g} s", frame.time));
      }
    }
  }

  void add_nodes(Animation& animation) {
    Json children = Json::array();
    for (BodySurface& body : bodies_) add_body(body, animation, children);
    const RigidPaths paths(shots_.front().surface.parent_path());
    for (const Obstacle& obstacle : obstacles_) {
      children.push_back(add_obstacle(obstacle, paths, animation));
    }
    const auto axes = upright_axes(render_request_of(first_.scene, shots_.front().surface).up);
    Mat3d turn;  // turns the vertical to y
    for (int k = 0; k < 3; ++k) {
      turn(0, k) = component(axes[0], k);
      turn(1, k) = component(axes[2], k);
      turn(2, k) = -component(axes[1], k);
    }
    const std::string name = first_.title.empty() ? "phyxel" : first_.title;
    const std::size_t root = file_.add(
        "nodes",
        {{"name", name}, {"rotation", quaternion_of(turn)}, {"children", std::move(children)}});
    file_.add("scenes", {{"name", name}, {"nodes", Json::array({root})}});
  }

  /// Adds a body: a node of the triangles that last, and a node for those that vanish after the
  /// same frame. All share the vertices and their targets.
  void add_body(BodySurface& body, Animation& animation, Json& children) {
    const std::string name = fmt::format("body {}", body.body + 1);
    const Colour colour = colouring_ ? Colour{1, 1, 1} : body_colour(body.body);
    const std::size_t material = file_.add("materials", material_of(name, colour, 0.6));
    std::map<std::size_t, std::vector<std::array<std::uint32_t, 3>>> by_end;
    for (std::size_t t = 0; t < body.triangle.size(); ++t) {
      const std::size_t last = last_[body.number[t]];
      if (last != never) by_end[last].push_back(body.triangle[t]);
    }
    for (auto end = by_end.rbegin(); end != by_end.rend(); ++end) {
      const auto& [last, triangles] = *end;
      const bool vanishes = last + 1 < chosen_.size();
      const std::string of_part =
          vanishes ? fmt::format("{} until t = {:g} s", name, shots_[chosen_[last]].time) : name;
      Json primitive{{"attributes", body.attributes},
                     {"indices", file_.add_triangles(triangles)},
                     {"material", material}};
      Json mesh{{"name", of_part}};
      if (!body.targets.empty()) {
        primitive["targets"] = body.targets;
        mesh["weights"] = std::vector<int>(body.target_names.size(), 0);
        mesh["extras"] = {{"targetNames", body.target_names}};
      }
      mesh["primitives"].push_back(std::move(primitive));
      const std::size_t number = file_.add("meshes", std::move(mesh));
      const std::size_t node = file_.add(
          "nodes", {{"name", of_part}, {"mesh", number}, {"translation", json_of(body.origin)}});
      animation.add_weights(node);
      if (vanishes) animation.add_end(node, last);
      children.push_back(node);
    }
  }

  std::size_t add_obstacle(const Obstacle& obstacle, const RigidPaths& paths,
                           Animation& animation) {
    std::vector<ObstacleStep> steps;
    for (const std::size_t shot : chosen_) steps.push_back(paths.at(obstacle, shots_[shot].time));
    const ObstacleStep& start = steps.front();
    const auto [middle, radius] = middle_of(first_.point);
    const Surface mesh =
        obstacle_mesh(obstacle, transpose(start.turn) * (middle - start.place), 4 * radius);
    Json primitive{
        {"attributes", {{"POSITION", file_.add_attribute(as_floats(mesh.position), true)}}},
        {"material", material_of_obstacle(obstacle.is_bounded())}};
    if (!mesh.normal.empty()) {
      primitive["attributes"]["NORMAL"] = file_.add_attribute(as_floats(mesh.normal), false);
    }
    std::vector<std::array<std::uint32_t, 3>> triangles;
    for (const Triangle& corners : mesh.triangle) {
      triangles.push_back({static_cast<std::uint32_t>(corners[0]),
                           static_cast<std::uint32_t>(corners[1]),
                           static_cast<std::uint32_t>(corners[2])});
    }
    primitive["indices"] = file_.add_triangles(triangles);
    const std::size_t number = file_.add(
        "meshes", {{"name", obstacle.name}, {"primitives", Json::array({std::move(primitive)})}});
    const std::size_t node = file_.add("nodes", {{"name", obstacle.name},
                                                 {"mesh", number},
                                                 {"translation", json_of(start.place)},
                                                 {"rotation", quaternion_of(start.turn)}});
    if (steps.size() > 1 && !obstacle.stands_still()) animation.add_places(node, steps);
    return node;
  }

  std::size_t material_of_obstacle(bool bounded) {
    std::optional<std::size_t>& made = obstacle_materials_[bounded ? 1 : 0];
    if (!made) {
      made = file_.add("materials",
                       material_of(bounded ? "obstacle" : "floor", obstacle_colour(bounded), 0.9));
    }
    return *made;
  }

  /// Adds the run's title, scene and colours to the file.
  void describe() {
    Json& extras = file_.json()["asset"]["extras"];
    extras["title"] = first_.title;
    extras["program"] = first_.program;
    extras["scene"] = first_.scene;
    for (const std::size_t shot : chosen_) extras["times"].push_back(shots_[shot].time);
    if (!colouring_) return;
    const ColourRange& range = colouring_->range;
    extras["colours"] = {{"field", colouring_->field},
                         {"low", range.low},
                         {"high", range.high},
                         {"logarithmic", range.logarithmic}};
  }

  const GltfRequest& request_;
  std::vector<Shot> shots_;
  FrameData first_;
  std::vector<BodySurface> bodies_;
  static constexpr std::size_t never = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> last_;  // chosen frame that draws each triangle last, or never
  std::vector<Obstacle> obstacles_;
  std::vector<std::size_t> chosen_;
  std::optional<Colouring> colouring_;
  std::optional<std::size_t> obstacle_materials_[2];
  std::vector<std::string> notes_;
  GltfFile file_;
};

}  // namespace

GltfExport gltf_of_run(const GltfRequest& request) { return Exporter(request).made(); }

}  // namespace phyxel::app
