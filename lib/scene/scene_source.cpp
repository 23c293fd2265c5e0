#include "scene/scene_source.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "model/walls.hpp"
#include "phyxel/error.hpp"
#include "phyxel/shapes.hpp"
#include "scene/scene_body.hpp"

namespace phyxel {
namespace {

/// Which keys a source of bodies uses, apart from the one that names it.
struct SourceKeys {
  std::vector<const char*> needed, optional;
  bool one_of_spacing_and_phyxels = false;
};

SourceKeys lattice_keys(std::vector<const char*> needed) {
  return {std::move(needed),
          {"spacing", "phyxels", "lattice", "jitter", "seed", "surfels", "grading"},
          true};
}

SourceKeys keys_of_source(const char* kind, const std::string& shape) {
  if (std::string(kind) == "mesh")
    return {{"phyxels"}, {"seed", "relaxations", "on_surface", "grading"}};
  if (std::string(kind) == "file" || std::string(kind) == "cloud") return {};
  if (is_paper_shape(shape)) return {{}, {"surfels"}};
  if (shape == "cylinder") return lattice_keys({"radius", "length"});
  if (shape == "sphere") return lattice_keys({"radius"});
  return lattice_keys({"size"});
}

/// Refuses keys that would have no effect, and asks for those that are needed.
void check_source_keys(const SceneTable& body, const char* kind, const std::string& shape) {
  const SourceKeys keys = keys_of_source(kind, shape);
  const std::string source = shape.empty() ? kind : fmt::format("shape = \"{}\"", shape);
  std::vector<std::string> used(keys.needed.begin(), keys.needed.end());
  used.insert(used.end(), keys.optional.begin(), keys.optional.end());
  for (const char* name : {"phyxels", "spacing", "size", "radius", "length", "lattice", "jitter",
                           "seed", "relaxations", "on_surface", "grading", "surfels"}) {
    if (!body.has(name) || std::find(used.begin(), used.end(), name) != used.end()) continue;
    body.refuse(name,
                fmt::format("found, but {} does not use it; allowed with {}: {}", source, source,
                            used.empty() ? "none" : fmt::format("{}", fmt::join(used, ", "))));
  }
  for (const char* name : keys.needed) {
    if (!body.has(name)) {
      throw InputError(
          fmt::format("{}: key body.{}: missing; {} needs it", body.where(kind), name, source));
    }
  }
  if (keys.one_of_spacing_and_phyxels) {
    body.expect_one_of({"spacing", "phyxels"});
  }
}

/// Where the phyxels of a body's shape are most accurate (`best_placement`).
ShapeRequest::Placement placement_for(const BodyRequest& body) {
  ShapeRequest shape = body.source.shape;
  shape.supports = source_of(body).supports;
  shape.grading = body.source.grading;
  if (shape.spacing == 0) shape.spacing = spacing_for(shape, std::max(1, body.source.phyxels));
  return best_placement(shape, body.closure.value_or(1) > 0 && !body.neighbourhood.one_sided());
}

}  // namespace

void check_file_exists(const SceneTable& body, const char* kind,
                       const std::filesystem::path& file) {
  std::error_code unknown;
  if (std::filesystem::is_directory(file, unknown)) {
    body.refuse(kind, fmt::format("{} found, which is a folder; allowed: a file", file.string()));
  }
  if (!std::filesystem::exists(file, unknown)) {
    body.refuse(kind, fmt::format("{} found, but there is no such file; allowed: a file, relative "
                                  "to the scene file's folder",
                                  file.string()));
  }
}

Grading read_grading(const SceneTable& table) {
  Grading grading;
  table.read("ratio", grading.ratio);
  table.read("growth", grading.growth);
  table.read("per_radius", grading.per_radius);
  table.read("across", grading.across);
  return grading;
}

std::vector<FinerRequest> read_finer(const SceneTable& table, double ratio) {
  std::vector<FinerRequest> all;
  for (const SceneTable& finer : table.tables("finer")) {
    finer.expect_one_of({"box", "ball"});
    FinerRequest request{read_selection(finer), ratio};
    finer.read("by", request.by);
    if (request.by > ratio) {
      finer.refuse("by", fmt::format("{:g} found; allowed: 1 to the ratio of the grading, {:g}",
                                     request.by, ratio));
    }
    all.push_back(request);
  }
  return all;
}

BodySource read_source(const SceneTable& body) {
  body.expect_one_of({"shape", "mesh", "file", "cloud"});
  BodySource source;
  ShapeRequest& shape = source.shape;
  body.read("shape", shape.name);
  if (body.has("shape")) {
    const std::vector<std::string>& known = shape_names();
    if (std::find(known.begin(), known.end(), shape.name) == known.end()) {
      body.refuse("shape", fmt::format("{} found{}; allowed: {}", in_quotes(shape.name),
                                       did_you_mean(shape.name, known), fmt::join(known, ", ")));
    }
  }
  const char* kind = "cloud";
  for (const char* other : {"shape", "mesh", "file"}) {
    if (body.has(other)) kind = other;
  }
  check_source_keys(body, kind, shape.name);
  body.read("mesh", source.mesh);
  body.read("file", source.file);
  body.read("cloud", source.cloud);
  if (body.has("mesh")) check_file_exists(body, kind, source.mesh);
  if (body.has("file")) check_file_exists(body, kind, source.file);
  body.read("phyxels", source.phyxels);
  body.read("spacing", shape.spacing);
  body.read("size", shape.size);
  body.read("radius", shape.radius);
  body.read("length", shape.length);
  body.read_choice("lattice", shape.placement);
  body.read("jitter", shape.jitter);
  body.read("surfels", shape.surface);
  body.read("seed", source.seed);
  body.read("relaxations", source.relaxations);
  body.read("on_surface", source.on_surface);
  if (body.has("grading") && source.on_surface == false) {
    body.refuse("on_surface",
                "false found, but a graded body has phyxels on its surface; allowed: true, or no "
                "grading");
  }
  shape.seed = source.seed;
  return source;
}

std::string name_of_source(const BodySource& source) {
  if (!source.shape.name.empty()) return source.shape.name;
  if (!source.cloud.empty()) return source.cloud;
  return (source.mesh.empty() ? source.file : source.mesh).stem().string();
}

void choose_placement(const SceneTable& table, BodyRequest& body) {
  ShapeRequest& shape = body.source.shape;
  const bool kernel = body.volume_rule == VolumeRule::kernel;
  if (kernel && !body.source.on_surface && !body.source.grading) body.source.on_surface = false;
  if (shape.name.empty() || is_paper_shape(shape.name)) return;
  if (table.has("lattice")) {
    if (const std::string objection = objection_to_placement(shape); !objection.empty()) {
      table.refuse("lattice", objection);
    }
  }
  if (!kernel && !table.has("lattice")) shape.placement = placement_for(body);
  if (kernel && shape.placement == ShapeRequest::Placement::fitted) {
    table.refuse("lattice",
                 "\"fitted\" found with volumes = \"kernel\", which takes phyxels on a surface for "
                 "ones with others all around; allowed: \"cells\"");
  }
  if (body.source.grading && shape.placement != ShapeRequest::Placement::fitted) {
    table.refuse("grading",
                 "found, but the phyxels lie in a lattice, as they do where they are few, and with "
                 "jitter, surfels = false, closure = 0, one-sided lists or the kernel's volumes; "
                 "allowed: lattice = \"fitted\"");
  }
  const bool is_random = shape.jitter > 0 || shape.placement == ShapeRequest::Placement::fitted;
  if (table.has("seed") && !is_random && !table.has("jitter")) {
    table.refuse("seed",
                 "found without jitter, the only thing random here; allowed: both or neither");
  }
}

}  // namespace phyxel
