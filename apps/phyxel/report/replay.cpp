/// The page of a trajectory.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "compose.hpp"
#include "phyxel/error.hpp"
#include "report/opening_view.hpp"
#include "report/page.hpp"
#include "report/rebuilt.hpp"
#include "report/replay_data.hpp"
#include "report/replay_obstacles.hpp"
#include "report/report.hpp"
#include "report/run_files.hpp"
#include "report/thinning.hpp"
#include "trajectory.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Bodies with more phyxels would take too long to rebuild.
constexpr std::size_t most_rebuilt = 1'000'000;
/// Every `stride`-th value.
template <class T>
std::vector<T> each(const std::vector<T>& values, std::size_t stride) {
  if (stride == 1) return values;
  std::vector<T> some;
  for (std::size_t k = 0; k < values.size(); k += stride) some.push_back(values[k]);
  return some;
}

/// The values at some places.
template <class T>
std::vector<T> some(const std::vector<T>& values, const std::vector<std::size_t>& places) {
  std::vector<T> chosen;
  for (const std::size_t k : places) chosen.push_back(values[k]);
  return chosen;
}

/// The name of a field with spaces.
std::string in_words(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

/// A trajectory on its way to a page.
class Replay {
 public:
  explicit Replay(const ReplayRequest& request)
      : request_(request),
        trajectory_(find_trajectory(request.input, {})),
        folder_(fs::is_directory(request.input) ? request.input : request.input.parent_path()),
        run_(folder_) {
    leave_out_half_shots();
    first_surface_ = read(trajectory_.shots.front().surface, {});
    first_phyxels_ = read(trajectory_.shots.front().phyxels, {});
    rebuild();
    find_obstacles();
  }

  Report report() {
    choose();
    Report report;
    report.frames = chosen_.size();
    const std::vector<Instance> instances = read_instances();
    order_triangles();
    report.surfels = instances.front().surfels.size();
    report.phyxels = instances.front().phyxels.size();
    report.fields = field_names_;
    for (const Obstacle& obstacle : obstacles_) report.obstacles.push_back(obstacle.name);
    report.notes = notes_;
    if (thins()) {
      report.notes.push_back(
          fmt::format("The surface is drawn with {} of its {} surfels, for a page below {:g} MB "
                      "(--max-megabytes).",
                      with_separators(report.surfels),
                      with_separators(first_surface_->point.size()), request_.megabytes));
    }
    report.html = page(instances);
    return report;
  }

 private:
  /// Reads a frame and checks its number of points against the first frame of its family; unset if
  /// the shot has none.
  static std::optional<FrameData> read(const fs::path& file,
                                       const std::optional<FrameData>& first) {
    if (file.empty()) return std::nullopt;
    FrameData frame = read_frame(file, true);
    if (first && frame.point.size() != first->point.size()) {
      throw InputError(fmt::format("{}: has {} points, the first frame {}", file.string(),
                                   frame.point.size(), first->point.size()));
    }
    return frame;
  }

  /// True if the page draws a part of the surfels.
  bool thins() const {
    return first_surface_ && shown_surface_.surfel.size() < first_surface_->point.size();
  }

  const FrameData& any() const { return first_phyxels_ ? *first_phyxels_ : *first_surface_; }

  /// Removes shots that lack a family of the first shot, as a run that was stopped may leave them.
  void leave_out_half_shots() {
    std::vector<Shot>& shots = trajectory_.shots;
    const bool surface = !shots.front().surface.empty(), phyxels = !shots.front().phyxels.empty();
    const std::size_t left_out = std::erase_if(shots, [&](const Shot& shot) {
      return shot.surface.empty() == surface || shot.phyxels.empty() == phyxels;
    });
    if (left_out == 0) return;
    notes_.push_back(
        fmt::format("{} frames are left out: unlike the first frame, they are not of {}.", left_out,
                    surface && phyxels ? "surface and phyxels"
                    : surface          ? "a surface alone"
                                       : "phyxels alone"));
  }

  /// Parses the scene of the frames, and rebuilds its model if it may.
  void rebuild() {
    std::string why;
    try {
      scene_ = parse_scene(any().scene, run_.scene_file());
    } catch (const InputError& error) {
      why = error.what();  // files that the scene names may have been moved
    }
    camera_ = camera_wishes(any().scene, "scene.toml");
    if (!request_.stress || !first_phyxels_) return;
    const std::size_t phyxels = first_phyxels_->point.size();
    if (phyxels > most_rebuilt) {
      notes_.push_back(
          fmt::format("Strains and stresses are those of the frames only: they are "
                      "computed for up to {} phyxels. output.fields writes them to frames.",
                      most_rebuilt));
      return;
    }
    try {
      if (scene_) {
        why =
            obstacle_to_building(*scene_, phyxels, typical_spacing(first_phyxels_->point), folder_);
        if (why.empty()) rebuilt_.emplace(*scene_, phyxels);
      }
    } catch (const InputError& error) {
      why = error.what();
    }
    if (!rebuilt_) {
      notes_.push_back(
          fmt::format("Strains and stresses are those of the frames only, since the scene cannot "
                      "be rebuilt: {}",
                      why));
    }
  }

  /// Reads the obstacles of the frames' scene.
  void find_obstacles() {
    const fs::path scene = run_.scene_file();
    try {
      DrawnObstacles drawn = drawn_obstacles(any().scene, scene, [&](const fs::path& mesh) {
        return obstacle_to_reading(mesh, scene, any().scene, folder_);
      });
      paths_ = RigidPaths(folder_);
      obstacles_ = std::move(drawn.obstacles);
      for (const std::string& line : drawn.left_out) notes_.push_back("The " + line + ".");
    } catch (const InputError& error) {
      notes_.push_back(fmt::format("Obstacles are left out: {}", error.what()));
    }
  }

  /// Chooses the frames and the phyxels that are shown.
  void choose() {
    for (const Field& field : fields_of(any())) {
      field_names_.push_back(field.name);
      field_units_.push_back(field.unit);
    }
    const std::size_t all = trajectory_.shots.size();
    const std::size_t phyxels = first_phyxels_ ? first_phyxels_->point.size() : 0;
    constexpr double as_text = 4.0 / 3;
    const auto fields = static_cast<double>(field_names_.size());
    const double of_phyxel = as_text * (6 + 2 * fields),
                 of_surfel = as_text * (6 + (phyxels ? 0 : 2 * fields));
    const double bytes = 1e6 * request_.megabytes - as_text * embedded_size(obstacles_) - 3e5;
    const double once_of_surfel = as_text * 5 * Carriers::each;
    if (first_surface_) {
      // Few enough surfels for a hundred frames beside the phyxels, which get half the page at
      // most.
      constexpr std::size_t frames = 100;
      const auto shown = static_cast<double>(std::min(all, frames));
      const double room =
          bytes - std::min(bytes / 2, of_phyxel * shown * static_cast<double>(phyxels));
      const auto count = static_cast<double>(first_surface_->point.size());
      const double of_triangles = as_text * 12 *
                                  static_cast<double>(first_surface_->triangle.size()) /
                                  std::max(1.0, count);
      const double once = once_of_surfel + of_triangles;
      // No fewer than 20,000 for the sake of frames, if ten frames of these take half the room.
      const double least = std::min(20'000.0, room / 2 / (once + 10 * of_surfel));
      const double most = std::max(least, room / (once + of_surfel * shown));
      shown_surface_ = thinned(*first_surface_, static_cast<std::size_t>(std::max(1.0, most)));
    }
    const auto surfels = static_cast<double>(shown_surface_.surfel.size());
    const double once = as_text * 12 * static_cast<double>(shown_surface_.triangle.size()) +
                        once_of_surfel * surfels;
    const FramePlan plan = plan_frames(all, of_surfel * surfels,
                                       of_phyxel * static_cast<double>(phyxels), bytes - once);
    stride_ = plan.phyxel_stride;
    FrameChoice choice;
    if (plan.frames < all) choice.count = static_cast<std::int64_t>(plan.frames);
    chosen_ = choose_frames(choice, all);
    if (plan.frames < all) {
      notes_.push_back(
          fmt::format("{} of {} frames are shown, evenly spaced: with all frames the "
                      "page would be larger than {:g} MB (--max-megabytes).",
                      chosen_.size(), all, request_.megabytes));
    }
    if (phyxels > 0 && stride_ != 1) {
      notes_.push_back(fmt::format(
          "One phyxel in {} is shown: with all phyxels the page would be larger than {:g} MB "
          "(--max-megabytes).",
          stride_, request_.megabytes));
    }
  }

  /// The fields of a frame, of phyxels or, without them, of surfels.
  std::vector<Field> fields_of(const FrameData& frame) {
    std::vector<Field> fields;
    const auto lengths = [](const std::vector<double>& vectors) {
      std::vector<double> values;
      for (std::size_t k = 0; k + 2 < vectors.size(); k += 3) {
        values.push_back(norm({vectors[k], vectors[k + 1], vectors[k + 2]}));
      }
      return values;
    };
    const auto written = [&](const char* field) -> const std::vector<double>* {
      const auto found = frame.field.find(field);
      return found == frame.field.end() ? nullptr : &found->second;
    };
    Field displacement{"displacement", "m", {}};
    if (const auto* u = written("displacement")) {
      displacement.values = lengths(*u);
    } else {
      // Displacements from rest, or from the first frame if the rest positions are unknown.
      if (!rebuilt_ && any().time != 0) {
        displacement.name += fmt::format(" since t = {:g} s", any().time);
      }
      const std::vector<Vec3d>& rest = rebuilt_ ? rebuilt_->rest() : any().point;
      for (std::size_t i = 0; i < frame.point.size(); ++i) {
        displacement.values.push_back(norm(frame.point[i] - rest[i]));
      }
    }
    fields.push_back(std::move(displacement));
    if (const auto* v = written("velocity")) fields.push_back({"speed", "m/s", lengths(*v)});
    if (const auto* s = written("von_mises")) fields.push_back({"stress (von Mises)", "Pa", *s});
    if (const auto* j = written("volume_ratio")) fields.push_back({"volume ratio", "", *j});
    for (const std::string& name : other_numbers(frame)) {
      fields.push_back({name == "broken" ? "broken share" : in_words(name), unit_of(name),
                        *written(name.c_str())});
    }
    if (rebuilt_) rebuilt_->add_fields(frame, fields);
    return fields;
  }

  /// Orders the triangles so that each frame has the first ones, where cracks cross more and more.
  void order_triangles() {
    if (!cracks_) return;
    std::vector<std::vector<Triangle>> of_frames;
    for (const std::size_t shot : chosen_) {
      of_frames.push_back(
          shown_surface_.shown(read_frame(trajectory_.shots[shot].surface).triangle));
    }
    uncut_ = sort_by_last_frame(shown_surface_.triangle, std::move(of_frames));
  }

  std::vector<Instance> read_instances() {
    std::vector<Instance> instances;
    if (!camera_.camera.follow.empty()) {
      followed_.emplace(camera_.camera.follow, any().scene, run_.scene_file(), RigidPaths(folder_));
    }
    for (const std::size_t shot : chosen_) {
      Instance& instance = instances.emplace_back();
      instance.time = trajectory_.shots[shot].time;
      const auto surface = read(trajectory_.shots[shot].surface, first_surface_);
      const auto phyxels = read(trajectory_.shots[shot].phyxels, first_phyxels_);
      if (followed_) {
        followed_->add(surface ? &*surface : nullptr, phyxels ? &*phyxels : nullptr);
        way_.push_back(followed_->way(way_.size()));
      }
      if (surface) instance.surfels = some(surface->point, shown_surface_.surfel);
      if (surface && surface->triangle.size() != first_surface_->triangle.size()) cracks_ = true;
      if (phyxels) instance.phyxels = each(phyxels->point, stride_);
      std::vector<Field> fields = fields_of(phyxels ? *phyxels : *surface);
      const bool same = std::equal(
          fields.begin(), fields.end(), field_names_.begin(), field_names_.end(),
          [](const Field& field, const std::string& name) { return field.name == name; });
      if (!same) {
        throw InputError(fmt::format(
            "{}: has other fields than the first frame",
            (phyxels ? trajectory_.shots[shot].phyxels : trajectory_.shots[shot].surface)
                .string()));
      }
      for (const Field& field : fields) {
        instance.fields.push_back(phyxels ? each(field.values, stride_)
                                          : some(field.values, shown_surface_.surfel));
      }
    }
    return instances;
  }

  std::string page(const std::vector<Instance>& instances) const {
    const Extent extent = extent_of(instances);
    const double spacing = first_phyxels_ ? std::cbrt(static_cast<double>(stride_)) *
                                                typical_spacing(first_phyxels_->point)
                                          : 0;
    std::vector<std::string> warnings = notes_;
    for (std::string& warning : run_.warnings()) warnings.push_back(std::move(warning));
    std::string title = any().title;
    if (title.empty()) title = fs::absolute(folder_).lexically_normal().filename().string();
    return filled_page("replay.html",
                       {{"title", html_text(title)},
                        {"summary", html_text(summary_line(instances.back().time))},
                        {"warnings", html_warnings(warnings)},
                        {"facts", html_facts(run_.facts(any().program))},
                        {"scene", html_text(any().scene)},
                        {"frames", embedded(instances, extent, spacing)},
                        {"data", script_json(data_of(instances, extent, spacing))},
                        {"footer", html_text(fmt::format("Simulated by {}, written by {}.",
                                                         any().program, program_version()))}});
  }

  /// The elements of the page that hold frames, triangles and carriers.
  std::string embedded(const std::vector<Instance>& instances, const Extent& extent,
                       double spacing) const {
    std::string elements;
    const auto embed = [&](const std::string& name, const auto& numbers) {
      elements += byte_element(name, std::as_bytes(std::span(numbers)));
    };
    for (std::size_t k = 0; k < instances.size(); ++k) {
      embed(fmt::format("frame{}", k), quantised(instances[k], extent));
    }
    const Instance& start = instances.front();
    if (!start.surfels.empty()) embed("triangles", shown_surface_.triangle);
    const auto embed_bodies = [&](const char* name, const std::vector<Index>& bodies) {
      if (std::all_of(bodies.begin(), bodies.end(), [](Index body) { return body == 0; })) return;
      embed(name, std::vector<std::uint16_t>(bodies.begin(), bodies.end()));
    };
    if (first_surface_ && first_surface_->body.size() == first_surface_->point.size()) {
      embed_bodies("surfels-bodies", some(first_surface_->body, shown_surface_.surfel));
    }
    if (first_phyxels_ && first_phyxels_->body.size() == first_phyxels_->point.size()) {
      embed_bodies("phyxels-bodies", each(first_phyxels_->body, stride_));
    }
    if (!start.surfels.empty() && !start.phyxels.empty()) {
      const Carriers carriers = carriers_of(start.surfels, start.phyxels, carrier_reach(spacing));
      embed("carriers", carriers.phyxel);
      embed("weights", carriers.weight);
    }
    elements += obstacle_elements(obstacles_, extent);
    return elements;
  }

  /// The data that the page's script reads. Lengths are in units of the radius, about the centre.
  Json data_of(const std::vector<Instance>& instances, const Extent& extent, double spacing) const {
    const std::vector<Span>& ranges = extent.ranges;
    const double radius = extent.radius;
    Json data = opening_view(camera_, instances, extent, way_);
    data["surfels"] = instances.front().surfels.size();
    data["phyxels"] = instances.front().phyxels.size();
    data["decimals"] = time_decimals(trajectory_.shots);
    for (const Instance& instance : instances) data["frames"].push_back(instance.time);
    data["fields"] = Json::array();
    std::vector<ColourRange> opening_ranges;
    for (std::size_t f = 0; f < field_names_.size(); ++f) {
      const std::vector<double> sample = sample_of(instances, f);
      const ColourRange bulk = linear_range(sample), decades = logarithmic_range(sample);
      const bool log = prefers_logarithm(sample);
      opening_ranges.push_back(log ? decades : bulk);
      data["fields"].push_back({{"name", field_names_[f]},
                                {"bulk", {bulk.low, bulk.high}},
                                {"decades", {decades.low, decades.high}},
                                {"log", log},
                                {"unit", field_units_[f]},
                                {"low", ranges[f].low},
                                {"high", ranges[f].low + ranges[f].width()}});
    }
    const Opening opening = opening_of(instances, field_names_, opening_ranges);
    data["opening"] = {{"frame", opening.frame}, {"field", opening.field}};
    std::vector<double> times;
    for (const Instance& instance : instances) times.push_back(instance.time);
    const bool floor = obstacles_.empty() && looks_down(camera_.view, camera_.up);
    data["obstacles"] =
        obstacles_json(floor ? std::vector{floor_under(instances, extent, camera_.up)} : obstacles_,
                       paths_, times, extent);
    data["only_floor"] = floor;
    if (!uncut_.empty()) data["uncut"] = uncut_;
    data["spacing"] = spacing / radius;
    data["reach"] = carrier_reach(spacing) / radius;
    data["carriers"] = Carriers::each;
    data["log"] = run_.log();
    data["timing"] = run_.timing();
    return data;
  }

  std::string summary_line(double end) const {
    std::string line;
    if (first_phyxels_) {
      line += with_separators(first_phyxels_->point.size()) + " phyxels, ";
    }
    if (first_surface_) {
      line += with_separators(first_surface_->point.size()) + " surfels, ";
      if (thins()) {
        line.replace(line.size() - 2, 2,
                     fmt::format(" ({} drawn), ", with_separators(shown_surface_.surfel.size())));
      }
    }
    return line + fmt::format("{} frames to t = {:g} s", trajectory_.shots.size(), end);
  }

  const ReplayRequest& request_;
  Trajectory trajectory_;
  fs::path folder_;
  std::optional<FrameData> first_surface_, first_phyxels_;
  RunFiles run_;
  std::optional<Scene> scene_;
  CameraWishes camera_;
  std::optional<FollowedBody> followed_;
  std::vector<Vec3d> way_;  // of the followed body, by chosen frames
  std::optional<Rebuilt> rebuilt_;
  std::vector<Obstacle> obstacles_;
  RigidPaths paths_;  // of those that are free bodies
  std::vector<std::size_t> chosen_;
  ThinnedSurface shown_surface_;    // of the first frame; empty without a surface
  bool cracks_ = false;             // true if later frames lack triangles of the first
  std::vector<std::size_t> uncut_;  // triangles of each frame; empty: all have all
  std::size_t stride_ = 1;
  std::vector<std::string> field_names_, field_units_, notes_;
};

}  // namespace

FramePlan plan_frames(std::size_t frames, double surface_bytes, double phyxel_bytes, double bytes) {
  struct Compromise {
    std::size_t stride, least_frames;
  };
  const auto fit = [&](std::size_t stride) {
    const double of_frame = surface_bytes + phyxel_bytes / static_cast<double>(stride);
    return std::min(static_cast<double>(frames),
                    std::floor(std::max(0.0, bytes) / std::max(1.0, of_frame)));
  };
  // The number of frames has priority over the number of phyxels, down to a minimum of frames.
  for (const Compromise c : {Compromise{1, 50}, {4, 50}, {16, 50}, {16, 10}, {64, 10}, {4096, 2}}) {
    const double shown = fit(c.stride);
    if (shown < static_cast<double>(std::min(frames, c.least_frames))) continue;
    std::size_t stride = 1;  // the smallest stride that shows nearly as many frames
    while (fit(stride) < 0.9 * shown) stride *= 4;
    return {static_cast<std::size_t>(fit(stride)), stride};
  }
  throw InputError(
      fmt::format("--max-megabytes: {:.3g} MB remain for frames, but the surfaces of two frames "
                  "take {:.3g} MB; allowed: a larger page, or a run with fewer surfels",
                  std::max(0.0, bytes) / 1e6, 2 * surface_bytes / 1e6));
}

Report replay_page(const ReplayRequest& request) {
  try {
    return Replay(request).report();
  } catch (const Json::exception& error) {  // for example a number in place of a text
    throw InputError(fmt::format("{}: run.json is not a summary of a run: {}",
                                 request.input.string(), error.what()));
  }
}

}  // namespace phyxel::app
