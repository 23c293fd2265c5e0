#include "report/rebuilt.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "files/atomic_file.hpp"
#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/point_fields.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

constexpr double most_pairs = 1e9;                           // pairs of neighbours: 4 GB of lists
constexpr double most_relaxed = 3e8;                         // phyxels times sweeps: some minutes
constexpr std::size_t largest_scene = std::size_t{2} << 20;  // [bytes], as for scene files

/// Equivalent strain sqrt(2/3 E':E'), where E' is the deviator of Green's strain.
/// @param e xx, yy, zz, xy, yz, xz
double equivalent_strain(std::span<const double, 6> e) {
  const double mean = (e[0] + e[1] + e[2]) / 3;
  const double x = e[0] - mean, y = e[1] - mean, z = e[2] - mean;
  return std::sqrt(2 * (x * x + y * y + z * z + 2 * (e[3] * e[3] + e[4] * e[4] + e[5] * e[5])) / 3);
}

/// Approximate number of phyxels of a source; 0 if it is not known in advance.
double phyxels_of(const BodySource& source) {
  if (!source.file.empty()) {
    check_seal(source.file, "body");
    return static_cast<double>(Hdf5Reader(source.file).shape("/position").rows);
  }
  if (source.phyxels > 0) return source.phyxels;
  const ShapeRequest& shape = source.shape;
  if (is_paper_shape(shape.name)) return 238;  // the smallest of these bodies
  const auto along = [&](double length) { return std::max(1.0, length / shape.spacing); };
  if (shape.name == "sphere") return std::pow(along(1.6 * shape.radius), 3);
  if (shape.name == "cylinder") return std::pow(along(1.7 * shape.radius), 2) * along(shape.length);
  return along(shape.size.x) * along(shape.size.y) * along(shape.size.z);
}

/// Approximate number of neighbours of a phyxel. @param spacing distance between phyxels [m]
double neighbours_of(const NeighbourhoodRule& rule, double phyxels, double spacing) {
  const double reach =
      rule.radius ? *rule.radius / std::max(spacing, 1e-300)
                  : rule.factor * std::cbrt(static_cast<double>(std::max(rule.nearest, 1)));
  return std::min(phyxels, 4.0 / 3 * std::numbers::pi * reach * reach * reach);
}

bool lies_in(const fs::path& file, const fs::path& folder) {
  std::error_code error;
  const fs::path inside =
      fs::weakly_canonical(file, error)
          .lexically_relative(fs::weakly_canonical(folder.empty() ? "." : folder, error));
  return !error && !inside.empty() && *inside.begin() != "..";
}

/// True if the scene's file exists with the same text.
bool is_users_own(const fs::path& file, const std::string& text) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return false;
  try {
    return read_text_file(file, largest_scene) == text;
  } catch (const InputError&) {
    return false;
  }
}

/// A scene without what its bodies touch, on which strains and stresses do not depend.
Scene without_contact(Scene scene) {
  scene.contact.reset();
  scene.obstacles.clear();
  return scene;
}

}  // namespace

std::string obstacle_to_reading(const fs::path& file, const fs::path& scene,
                                const std::string& text, const fs::path& folder) {
  std::error_code ignored;
  if (!lies_in(file, folder) && !is_users_own(scene, text)) {
    return fmt::format(
        "it names {}, which is outside the run's folder, and {} does not exist with the same text",
        file.string(), scene.string());
  }
  if (!fs::is_regular_file(file, ignored)) {
    return fmt::format("{} is not a regular file", file.string());
  }
  return "";
}

std::string obstacle_to_building(const Scene& scene, std::size_t phyxels, double spacing,
                                 const fs::path& folder) {
  const auto most = 1.5 * static_cast<double>(phyxels) + 1000;
  double all = 0, pairs = 0, relaxed = 0;
  for (const BodyRequest& body : scene.bodies) {
    for (const fs::path& file : {body.source.mesh, body.source.file}) {
      if (file.empty()) continue;
      const std::string why = obstacle_to_reading(file, scene.file, scene.text, folder);
      if (!why.empty()) return why;
    }
    const double some = phyxels_of(body.source);
    const double apart = body.source.shape.spacing > 0 ? body.source.shape.spacing : spacing;
    all += some;
    pairs += some * neighbours_of(body.neighbourhood, some, body.scale * apart);
    if (!body.source.mesh.empty()) relaxed += some * body.source.relaxations;
    // The negated comparison also refuses NaN.
    if (!(all <= most)) {
      return fmt::format("it asks for about {:.3g} phyxels, the frames have {}", all, phyxels);
    }
    if (!(pairs <= most_pairs)) {
      return fmt::format("it asks for about {:.3g} neighbours; allowed here: {:g}", pairs,
                         most_pairs);
    }
    if (!(relaxed <= most_relaxed)) {
      return fmt::format("it asks for {:.3g} phyxels times relaxations; allowed here: {:g}",
                         relaxed, most_relaxed);
    }
  }
  return "";
}

Rebuilt::Rebuilt(Scene scene, std::size_t phyxels)
    : scene_(without_contact(std::move(scene))), model_(build_model(scene_)) {
  if (static_cast<std::size_t>(model_.size()) != phyxels) {
    throw InputError(fmt::format("it has {} phyxels now, the frames {}", model_.size(), phyxels));
  }
  backend_ = make_cpu_backend(model_, scene_.solver.precision, scene_.solver.threads);
  if (scene_.output.recovery) recovery_.emplace(model_);
}

void Rebuilt::add_fields(const FrameData& frame, std::vector<Field>& fields) {
  const auto has = [&](const char* name) {
    return std::any_of(fields.begin(), fields.end(),
                       [&](const Field& field) { return field.name == name; });
  };
  State state;
  state.velocity.resize(frame.point.size());
  state.displacement.resize(frame.point.size());
  for (std::size_t i = 0; i < frame.point.size(); ++i) {
    state.displacement[i] = frame.point[i] - model_.position[i];
  }
  if (const auto u = frame.field.find("displacement"); u != frame.field.end()) {
    for (std::size_t i = 0; i < frame.point.size(); ++i) {  // in full precision
      state.displacement[i] = {u->second[3 * i], u->second[3 * i + 1], u->second[3 * i + 2]};
    }
  }
  backend_->upload(state);
  const Quantity wanted[] = {Quantity::strain, Quantity::von_mises, Quantity::volume_ratio};
  FieldValues found = find_fields(model_, *backend_, wanted, recovery_ ? &*recovery_ : nullptr);
  Field strain{"strain (equivalent)", "", {}};
  const std::vector<double>& green = found[Quantity::strain];
  for (std::size_t i = 0; i < frame.point.size(); ++i) {
    strain.values.push_back(equivalent_strain(std::span(green).subspan(6 * i).first<6>()));
  }
  fields.push_back(std::move(strain));
  if (!has("stress (von Mises)")) {
    fields.push_back({"stress (von Mises)", "Pa", std::move(found[Quantity::von_mises])});
  }
  if (!has("volume ratio")) {
    fields.push_back({"volume ratio", "", std::move(found[Quantity::volume_ratio])});
  }
}

}  // namespace phyxel::app
