/// A trajectory as a page.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "compose.hpp"
#include "csv.hpp"
#include "files/atomic_file.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "phyxel/neighbourhood.hpp"
#include "report/page.hpp"
#include "report/rebuilt.hpp"
#include "report/report.hpp"
#include "scene/upright.hpp"
#include "trajectory.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// A body of more takes longer to build anew than anyone waits for a page.
constexpr std::size_t most_rebuilt = 1'000'000;
constexpr double steps_of_16_bits = 65535;

/// For each surfel the phyxels that colour it, and by how many 255ths, shape [surfels, carriers].
struct Carriers {
  static constexpr std::size_t each = 4;
  std::vector<std::uint32_t> phyxel;
  std::vector<std::uint8_t> weight;
};

/// The nearest of those in reach; the nearest one where there is none.
Carriers carriers_of(const std::vector<Vec3d>& surfels, const std::vector<Vec3d>& phyxels,
                     double reach) {
  Carriers made;
  const std::vector<double> support(phyxels.size(), reach);
  const Csr rows = phyxels_near(surfels, phyxels, support);
  std::vector<std::pair<double, Index>> near;
  for (Index s = 0; s < rows.rows(); ++s) {
    near.clear();
    for (const Index i : rows.row(s)) {
      near.emplace_back(
          norm(phyxels[static_cast<std::size_t>(i)] - surfels[static_cast<std::size_t>(s)]) / reach,
          i);
    }
    std::sort(near.begin(), near.end());
    near.resize(std::min(near.size(), Carriers::each));
    double sum = 0;
    const auto weight = [](double q) { return std::pow(std::max(1e-3, 1 - q * q), 3); };
    for (const auto& [q, i] : near) sum += weight(q);
    int left = 255;
    for (std::size_t k = 0; k < Carriers::each; ++k) {
      const bool there = k < near.size();
      made.phyxel.push_back(static_cast<std::uint32_t>(near[there ? k : 0].second));
      const int share =
          there ? static_cast<int>(std::lround(255 * weight(near[k].first) / sum)) : 0;
      made.weight.push_back(static_cast<std::uint8_t>(std::min(left, share)));
      left -= made.weight.back();
    }
    made.weight[made.weight.size() - Carriers::each] += static_cast<std::uint8_t>(left);
  }
  return made;
}

template <class T>
std::vector<T> each(const std::vector<T>& values, std::size_t stride) {
  if (stride == 1) return values;
  std::vector<T> some;
  for (std::size_t k = 0; k < values.size(); k += stride) some.push_back(values[k]);
  return some;
}

/// What numbers span.
struct Span {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void include(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double width() const { return high > low ? high - low : 1; }
  std::uint16_t step_of(double value) const {
    if (!std::isfinite(value)) return 0;
    return static_cast<std::uint16_t>(
        std::lround(std::clamp((value - low) / width(), 0.0, 1.0) * steps_of_16_bits));
  }
};

/// One shown instant: points of both families, and fields of the phyxels; of the surfels if there
/// are none.
struct Instance {
  double time = 0;
  std::vector<Vec3d> surfels, phyxels;
  std::vector<std::vector<double>> fields;  // [field][point]
};

/// Between which nearly all values of a field lie: the 1st and the 99th percentile of a sample.
std::pair<double, double> bulk_of(const std::vector<Instance>& instances, std::size_t field) {
  std::size_t all = 0;
  for (const Instance& instance : instances) all += instance.fields[field].size();
  const std::size_t every = 1 + all / 1'000'000;
  std::vector<double> sample;
  std::size_t k = 0;
  for (const Instance& instance : instances) {
    for (const double value : instance.fields[field]) {
      if (k++ % every == 0 && std::isfinite(value)) sample.push_back(value);
    }
  }
  if (sample.empty()) return {0, 1};
  const auto at = [&](double share) {
    const auto place = sample.begin() +
                       static_cast<std::ptrdiff_t>(share * static_cast<double>(sample.size() - 1));
    std::nth_element(sample.begin(), place, sample.end());
    return *place;
  };
  const double low = at(0.01);
  return {low, at(0.99)};
}

/// Of all points that are shown, the farthest in 26 directions: enough to put all into a picture.
class Outermost {
 public:
  void include(Vec3d p) {
    if (!std::isfinite(p.x + p.y + p.z)) return;
    for (std::size_t k = 0; k < found_.size(); ++k) {
      const double far = dot(p, direction(k));
      if (far > farthest_[k]) {
        farthest_[k] = far;
        found_[k] = p;
      }
    }
  }
  const std::array<Vec3d, 27>& points() const { return found_; }

 private:
  static Vec3d direction(std::size_t k) {
    const auto part = [&](std::size_t by) { return static_cast<double>(k / by % 3) - 1; };
    return {part(1), part(3), part(9)};
  }
  std::array<Vec3d, 27> found_{};
  std::array<double, 27> farthest_ = [] {
    std::array<double, 27> none{};
    none.fill(-std::numeric_limits<double>::infinity());
    return none;
  }();
};

/// A list of numbers with few digits.
Json few_digits(const std::vector<std::string>& cells) {
  Json row = Json::array();
  for (const std::string& cell : cells) {
    const double value = std::strtod(cell.c_str(), nullptr);
    if (std::isfinite(value)) {
      row.push_back(std::strtod(fmt::format("{:.7g}", value).c_str(), nullptr));
    } else {
      row.push_back(nullptr);
    }
  }
  return row;
}

std::string with_separators(std::size_t number) {
  std::string text = std::to_string(number);
  for (auto at = static_cast<int>(text.size()) - 3; at > 0; at -= 3) {
    text.insert(static_cast<std::size_t>(at), ",");
  }
  return text;
}

class Replay {
 public:
  explicit Replay(const ReplayRequest& request)
      : request_(request),
        trajectory_(find_trajectory(request.input, {})),
        folder_(fs::is_directory(request.input) ? request.input : request.input.parent_path()) {
    leave_out_half_shots();
    first_surface_ = read(trajectory_.shots.front().surface, {});
    first_phyxels_ = read(trajectory_.shots.front().phyxels, {});
    read_summary();
    rebuild();
  }

  Report report() {
    choose();
    Report report;
    report.frames = chosen_.size();
    const std::vector<Instance> instances = read_instances();
    report.surfels = instances.front().surfels.size();
    report.phyxels = instances.front().phyxels.size();
    report.fields = field_names_;
    report.notes = notes_;
    report.html = page(instances);
    return report;
  }

 private:
  /// A frame of the family that begins with `first`; nothing if the shot has none.
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

  const FrameData& any() const { return first_phyxels_ ? *first_phyxels_ : *first_surface_; }

  /// A run that was stopped, or whose files somebody has put together, may have shots without one
  /// of the families that its first shot has.
  void leave_out_half_shots() {
    std::vector<Shot>& shots = trajectory_.shots;
    const bool surface = !shots.front().surface.empty(), phyxels = !shots.front().phyxels.empty();
    const std::size_t left_out = std::erase_if(shots, [&](const Shot& shot) {
      return shot.surface.empty() == surface || shot.phyxels.empty() == phyxels;
    });
    if (left_out == 0) return;
    notes_.push_back(fmt::format("{} frames are left out: they are not of {}, as the first is.",
                                 left_out,
                                 surface && phyxels ? "surface and phyxels"
                                 : surface          ? "a surface alone"
                                                    : "phyxels alone"));
  }

  /// run.json, if the run came to its end.
  void read_summary() {
    const fs::path file = folder_ / "run.json";
    if (!fs::exists(file)) return;
    try {
      summary_ = Json::parse(read_text_file(file, std::size_t{1} << 24));
    } catch (const Json::exception& error) {
      throw InputError(fmt::format("{}: is no JSON: {}", file.string(), error.what()));
    }
    if (!summary_.is_object()) {
      throw InputError(fmt::format("{}: is no summary of a run", file.string()));
    }
  }

  void rebuild() {
    std::string why;
    try {
      scene_ = parse_scene(any().scene, summary_.value("scene", std::string("scene.toml")));
    } catch (const InputError& error) {
      why = error.what();  // files that it names may be elsewhere by now
    }
    try {
      pictures_ = parse_render(any().scene, "scene.toml");
    } catch (const InputError&) {  // the defaults serve
    }
    if (!request_.stress || !first_phyxels_) return;
    const std::size_t phyxels = first_phyxels_->point.size();
    if (phyxels > most_rebuilt) {
      notes_.push_back(
          fmt::format("No strain and no stress but those in the frames: they are found "
                      "anew for up to {} phyxels. output.fields has some written.",
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
      notes_.push_back(fmt::format(
          "No strain and no stress but those in the frames, as the scene cannot be built anew: {}",
          why));
    }
  }

  /// Which frames are shown, and which phyxels.
  void choose() {
    for (const Field& field : fields_of(any())) {
      field_names_.push_back(field.name);
      field_units_.push_back(field.unit);
    }
    const std::size_t surfels = first_surface_ ? first_surface_->point.size() : 0;
    const std::size_t phyxels = first_phyxels_ ? first_phyxels_->point.size() : 0;
    const std::size_t triangles = first_surface_ ? first_surface_->triangle.size() : 0;
    constexpr double as_text = 4.0 / 3;
    const std::size_t all = trajectory_.shots.size();
    const double fields = static_cast<double>(field_names_.size());
    const double once = static_cast<double>(12 * triangles + 5 * Carriers::each * surfels);
    const FramePlan plan =
        plan_frames(all, as_text * static_cast<double>(surfels) * (6 + (phyxels ? 0 : 2 * fields)),
                    as_text * static_cast<double>(phyxels) * (6 + 2 * fields),
                    1e6 * request_.megabytes - as_text * once - 3e5);
    stride_ = plan.phyxel_stride;
    FrameChoice choice;
    if (plan.frames < all) choice.count = static_cast<std::int64_t>(plan.frames);
    chosen_ = choose_frames(choice, all);
    if (plan.frames < all) {
      notes_.push_back(
          fmt::format("{} of {} frames are shown, evenly spread: all would make the "
                      "page larger than {:g} MB (--max-megabytes).",
                      chosen_.size(), all, request_.megabytes));
    }
    if (phyxels > 0 && stride_ != 1) {
      notes_.push_back(fmt::format("One phyxel in {} is shown, for the same reason.", stride_));
    }
  }

  /// All fields of a frame: of phyxels, or of surfels where there are none.
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
      // From the state at rest, if anyone knows it.
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
    if (rebuilt_) rebuilt_->add_fields(frame, fields);
    return fields;
  }

  std::vector<Instance> read_instances() {
    std::vector<Instance> instances;
    for (const std::size_t shot : chosen_) {
      Instance& instance = instances.emplace_back();
      instance.time = trajectory_.shots[shot].time;
      const auto surface = read(trajectory_.shots[shot].surface, first_surface_);
      const auto phyxels = read(trajectory_.shots[shot].phyxels, first_phyxels_);
      if (surface) instance.surfels = surface->point;
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
        instance.fields.push_back(each(field.values, phyxels ? stride_ : 1));
      }
    }
    return instances;
  }

  std::string page(const std::vector<Instance>& instances) const {
    Span box[3];
    Outermost outermost;
    std::vector<Span> ranges(field_names_.size());
    for (const Instance& instance : instances) {
      for (const auto* points : {&instance.surfels, &instance.phyxels}) {
        for (const Vec3d p : *points) {
          box[0].include(p.x);
          box[1].include(p.y);
          box[2].include(p.z);
          outermost.include(p);
        }
      }
      for (std::size_t f = 0; f < instance.fields.size(); ++f) {
        for (const double value : instance.fields[f]) ranges[f].include(value);
      }
    }
    double radius = 0;
    for (const Span& side : box) radius += side.width() * side.width() / 4;
    radius = std::sqrt(radius);

    std::string frames;
    const auto embed = [&](const std::string& name, const auto& numbers) {
      frames += fmt::format("<script type=\"application/octet-stream\" id=\"{}\">{}</script>\n",
                            name, base64(std::as_bytes(std::span(numbers))));
    };
    for (std::size_t k = 0; k < instances.size(); ++k) {
      embed(fmt::format("frame{}", k), numbers_of(instances[k], box, ranges));
    }
    const Instance& start = instances.front();
    const double spacing = first_phyxels_ ? std::cbrt(static_cast<double>(stride_)) *
                                                typical_spacing(first_phyxels_->point)
                                          : 0;
    if (!start.surfels.empty()) embed("triangles", first_surface_->triangle);
    if (!start.surfels.empty() && !start.phyxels.empty()) {
      const Carriers carriers =
          carriers_of(start.surfels, start.phyxels, spacing > 0 ? 1.6 * spacing : 1);
      embed("carriers", carriers.phyxel);
      embed("weights", carriers.weight);
    }

    Json data;
    data["surfels"] = instances.front().surfels.size();
    data["phyxels"] = instances.front().phyxels.size();
    data["decimals"] = time_decimals(trajectory_.shots);
    for (const Instance& instance : instances) data["frames"].push_back(instance.time);
    data["fields"] = Json::array();
    for (std::size_t f = 0; f < field_names_.size(); ++f) {
      const auto [bulk_low, bulk_high] = bulk_of(instances, f);
      data["fields"].push_back({{"name", field_names_[f]},
                                {"bulk", {bulk_low, bulk_high}},
                                {"unit", field_units_[f]},
                                {"low", ranges[f].low},
                                {"high", ranges[f].low + ranges[f].width()}});
    }
    for (const Span& side : box) {
      data["scale"].push_back(side.width() / steps_of_16_bits / radius);
      data["low"].push_back(-side.width() / 2 / radius);
    }
    for (const Vec3d p : outermost.points()) {
      const auto from_centre = [&](double at, const Span& side) {
        return (at - side.low - side.width() / 2) / radius;
      };
      data["outermost"].push_back(
          {from_centre(p.x, box[0]), from_centre(p.y, box[1]), from_centre(p.z, box[2])});
    }
    data["spacing"] = spacing / radius;
    data["carriers"] = Carriers::each;
    const auto axes = upright_axes(pictures_.up);
    const auto along = [&](int axis) { return -dot(pictures_.view, axes[axis]); };
    data["view"] = {{"yaw", std::atan2(along(1), along(0))},
                    {"pitch", std::atan2(along(2), std::hypot(along(0), along(1)))}};
    for (const Vec3d axis : axes) data["axes"].push_back({axis.x, axis.y, axis.z});
    data["log"] = log();
    data["timing"] = Json::array();
    if (summary_.contains("seconds")) {
      for (const auto& [what, seconds] : summary_["seconds"].items()) {
        data["timing"].push_back({what, seconds});
      }
    }

    std::vector<std::string> warnings = notes_;
    if (summary_.contains("warnings")) {
      for (const auto& warning : summary_["warnings"]) warnings.push_back(warning);
    }
    if (summary_.value("inverted_phyxels", 0) > 0) {
      warnings.push_back(fmt::format("{} phyxels are inside out at the end.",
                                     summary_["inverted_phyxels"].get<int>()));
    }
    std::string title = any().title;
    if (title.empty()) title = fs::absolute(folder_).lexically_normal().filename().string();
    return filled_page("replay.html",
                       {{"title", html_text(title)},
                        {"summary", html_text(summary_line(instances.back().time))},
                        {"warnings", html_warnings(warnings)},
                        {"facts", html_facts(facts())},
                        {"scene", html_text(any().scene)},
                        {"frames", frames},
                        {"data", script_json(data)},
                        {"footer", html_text(fmt::format("Simulated by {}, written by {}.",
                                                         any().program, program_version()))}});
  }

  static std::vector<std::uint16_t> numbers_of(const Instance& instance, const Span (&box)[3],
                                               const std::vector<Span>& ranges) {
    std::vector<std::uint16_t> numbers;
    for (const auto* points : {&instance.surfels, &instance.phyxels}) {
      for (const Vec3d p : *points) {
        numbers.insert(numbers.end(),
                       {box[0].step_of(p.x), box[1].step_of(p.y), box[2].step_of(p.z)});
      }
    }
    for (std::size_t f = 0; f < instance.fields.size(); ++f) {
      for (const double value : instance.fields[f]) numbers.push_back(ranges[f].step_of(value));
    }
    return numbers;
  }

  Json log() const {
    Json log{{"columns", Json::array()}, {"rows", Json::array()}};
    const fs::path file = folder_ / "energy.csv";
    if (!fs::exists(file)) return log;
    const CsvTable table = read_csv(file);
    log["columns"] = table.columns;
    // A chart has no use for more points than it is wide.
    const std::size_t step = 1 + table.rows.size() / 4000;
    for (std::size_t r = 0; r < table.rows.size(); r += step) {
      log["rows"].push_back(few_digits(table.rows[r]));
    }
    return log;
  }

  std::string summary_line(double end) const {
    std::string line;
    if (first_phyxels_) {
      line += with_separators(first_phyxels_->point.size()) + " phyxels, ";
    }
    if (first_surface_) {
      line += with_separators(first_surface_->point.size()) + " surfels, ";
    }
    return line + fmt::format("{} frames to t = {:g} s", trajectory_.shots.size(), end);
  }

  Facts facts() const {
    Facts facts;
    const auto add = [&](const char* name, const char* key, auto&& words) {
      if (summary_.contains(key) && !summary_[key].is_null()) {
        facts.emplace_back(name, words(summary_[key]));
      }
    };
    const auto text = [](const Json& value) {
      return value.is_string() ? value.get<std::string>() : json_text(value, -1);
    };
    const auto number = [](const char* unit) {
      return
          [unit](const Json& value) { return fmt::format("{:.4g}{}", value.get<double>(), unit); };
    };
    add("scene", "scene", text);
    add("device", "device", text);
    add("ranks", "ranks", text);
    add("method", "method", text);
    add("neighbours of a phyxel", "neighbours_per_phyxel", number(""));
    add("steps", "steps", text);
    add("time step", "time_step_s", number(" s"));
    if (summary_.value("method", "") == method_name(Method::verlet)) {
      add("largest stable step", "largest_stable_step_s", number(" s"));
    }
    add("speed", "phyxel_steps_per_second", number(" phyxel-steps/s"));
    add("memory", "bytes",
        [](const Json& value) { return fmt::format("{:.4g} MB", value.get<double>() / 1e6); });
    if (summary_.value("conservative", false)) {
      add("drift of energy", "energy_drift", number(" of the largest kinetic + elastic energy"));
    }
    add("internal forces sum to", "internal_force_balance", number(" of their size"));
    add("their torques to", "internal_torque_balance", number(" of theirs"));
    if (summary_.empty()) {
      facts.emplace_back("program", any().program);
      facts.emplace_back("",
                         "No run.json: the run was stopped, is under way, or was not phyxel run.");
    }
    return facts;
  }

  const ReplayRequest& request_;
  Trajectory trajectory_;
  fs::path folder_;
  std::optional<FrameData> first_surface_, first_phyxels_;
  Json summary_ = Json::object();
  std::optional<Scene> scene_;
  RenderRequest pictures_;
  std::optional<Rebuilt> rebuilt_;
  std::vector<std::size_t> chosen_;
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
  // Motion before detail, until it is no motion any more.
  for (const Compromise c : {Compromise{1, 50}, {4, 50}, {16, 50}, {16, 10}, {64, 10}, {4096, 2}}) {
    const double shown = fit(c.stride);
    if (shown < static_cast<double>(std::min(frames, c.least_frames))) continue;
    std::size_t stride = 1;  // none is left out for nothing
    while (fit(stride) < 0.9 * shown) stride *= 4;
    return {static_cast<std::size_t>(fit(stride)), stride};
  }
  throw InputError(
      fmt::format("--max-megabytes: {:.3g} MB are left for frames, of whose surface two take "
                  "{:.3g} MB: allowed: "
                  "more, or a run with fewer surfels",
                  std::max(0.0, bytes) / 1e6, 2 * surface_bytes / 1e6));
}

Report replay_page(const ReplayRequest& request) {
  try {
    return Replay(request).report();
  } catch (const Json::exception& error) {  // numbers where words should be, or the like
    throw InputError(fmt::format("{}: run.json is no summary of a run: {}", request.input.string(),
                                 error.what()));
  }
}

}  // namespace phyxel::app
