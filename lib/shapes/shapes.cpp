#include "phyxel/shapes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "model/host_memory.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "shapes/lattice_cuts.hpp"
#include "shapes/lattice_shapes.hpp"
#include "shapes/paper_bodies.hpp"

namespace phyxel {
namespace {

void check_positive(const std::string& shape, const char* key, double value) {
  if (std::isfinite(value) && value > 0) return;
  throw InputError(fmt::format("shape \"{}\": {} = {}: a finite length above 0 m is allowed", shape,
                               key, value));
}

void check_name(const std::string& name) {
  const std::vector<std::string>& names = shape_names();
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  throw InputError(fmt::format("unknown shape \"{}\"{}: known are {}", name,
                               did_you_mean(name, names), fmt::join(names, ", ")));
}

/// Refuses a placement that a shape cannot have.
void check_placement(const ShapeRequest& request) {
  const std::string objection = objection_to_placement(request);
  if (objection.empty()) return;
  throw InputError(fmt::format("shape \"{}\": lattice = {}", request.name, objection));
}

void check_size(const ShapeRequest& request) {
  check_name(request.name);
  if (request.name == "beam" || request.name == "block") {
    check_positive(request.name, "size.x", request.size.x);
    check_positive(request.name, "size.y", request.size.y);
    check_positive(request.name, "size.z", request.size.z);
  } else {
    if (request.placement == ShapeRequest::Placement::nodes) check_placement(request);
    check_positive(request.name, "radius", request.radius);
    if (request.name == "cylinder") check_positive(request.name, "length", request.length);
  }
  const double volume = make_lattice(request, 1).volume();
  if (!(volume > 1e-280 &&
        volume < 1e280)) {  // products with counts and densities must not overflow
    throw InputError(fmt::format("shape \"{}\": a volume of {} m^3; allowed: 1e-280 to 1e280 m^3",
                                 request.name, volume));
  }
}

/// Checks the memory for positions, volumes, their order and a copy of each.
void require_memory_for_cloud(const std::string& shape, double phyxels, Piece piece = {}) {
  constexpr double bytes_per_phyxel = 120;
  require_host_memory(fmt::format("shape \"{}\"", shape), phyxels, bytes_per_phyxel / piece.of);
}

void check_spacing(const ShapeRequest& request) {
  check_size(request);
  check_positive(request.name, "spacing", request.spacing);
  const Vec3d extent = make_lattice(request, 1).extent;
  const double longest = std::max({extent.x, extent.y, extent.z});
  if (request.spacing > longest * (1 + 1e-9)) {  // rounding of a spacing equal to it
    throw InputError(fmt::format(
        "shape \"{}\": spacing = {} m is larger than the whole shape: at most {} m is allowed",
        request.name, request.spacing, longest));
  }
}

void check_request(const ShapeRequest& request) {
  check_spacing(request);
  if (!(request.jitter >= 0 && request.jitter <= 0.5)) {
    throw InputError(fmt::format("shape \"{}\": jitter = {}: 0 to 0.5 spacings are allowed",
                                 request.name, request.jitter));
  }
  check_placement(request);
  if (request.grading && request.placement != ShapeRequest::Placement::fitted) {
    throw InputError(fmt::format(
        "shape \"{}\": lattice = \"{}\" found, which cannot be graded; allowed: \"fitted\", or no "
        "grading",
        request.name, request.placement == ShapeRequest::Placement::nodes ? "nodes" : "cells"));
  }
}

/// The number of phyxels of a fitted shape.
double fitted_phyxels(const ShapeRequest& request) {
  const double volume = make_lattice(request, request.spacing).volume();
  return std::max(1.0, std::round(volume / std::pow(request.spacing, 3)));
}

/// Fills a shape as a mesh is filled.
Cloud make_fitted_shape(const ShapeRequest& request) {
  check_request(request);
  const double phyxels = fitted_phyxels(request);
  if (phyxels > std::numeric_limits<Index>::max()) {
    throw InputError(fmt::format("shape \"{}\": {:.4g} phyxels; allowed are at most {}",
                                 request.name, phyxels, std::numeric_limits<Index>::max()));
  }
  // Phyxels lie on a polygon whose area is 0.04% below that of its circle. Surfels are as far apart
  // as phyxels, but nearer on coarse bodies, where they have 0.07% less.
  constexpr int corners = 128, surfel_corners = 96;
  const Lattice lattice = make_lattice(request, request.spacing);
  const Surface surface = lattice_surface(lattice, request.spacing, corners);
  SampleReport report;
  Cloud cloud = sample_surface(surface,
                               {.phyxels = static_cast<Index>(phyxels),
                                .seed = request.seed,
                                .on_surface = {},
                                .cuts = regions_of(request.supports),
                                .grading = request.grading},
                               &report);
  for (const std::string& warning : report.warnings) {
    cloud.warnings.push_back(fmt::format("shape \"{}\": {}", request.name, warning));
  }
  double finest = request.spacing;
  for (const double spacing : cloud.spacing) finest = std::min(finest, spacing);
  cloud.surface = lattice_surface(lattice, finest, surfel_corners);
  const double all = std::accumulate(cloud.volume.begin(), cloud.volume.end(), 0.0);
  for (double& volume : cloud.volume) volume *= lattice.volume() / all;
  return cloud;
}

}  // namespace

const std::vector<std::string>& shape_names() {
  static const std::vector<std::string> names{"beam",       "block",    "cylinder", "sphere",
                                              "alien_head", "horn_bug", "dino"};
  return names;
}

bool is_paper_shape(const std::string& name) { return find_paper_body(name) != nullptr; }

double spacing_for(const ShapeRequest& request, Index phyxels) {
  return spacing_for(request, phyxels, {});
}

double spacing_for(const ShapeRequest& request, Index phyxels, Piece piece) {
  if (const PaperBody* body = find_paper_body(request.name)) {
    throw InputError(fmt::format("shape \"{}\" is not a lattice: it has {} phyxels and no spacing",
                                 body->name, body->phyxels));
  }
  check_size(request);
  if (phyxels < 1) {
    throw InputError(fmt::format("shape \"{}\": {} phyxels asked for; at least 1 is needed",
                                 request.name, phyxels));
  }
  require_memory_for_cloud(request.name, phyxels, piece);
  const Lattice unit = make_lattice(request, 1);
  if (request.placement == ShapeRequest::Placement::fitted) {
    return std::cbrt(unit.volume() / phyxels);
  }
  const double longest = std::max({unit.extent.x, unit.extent.y, unit.extent.z});
  const auto count = [&](double spacing) { return make_lattice(request, spacing).phyxels(); };
  const double guess = std::min(std::cbrt(unit.volume() / phyxels), longest);
  if (count(guess) == phyxels) return guess;
  // Cell counts are integers, so the number of phyxels jumps: the nearer side of the jump is taken.
  double few = longest, many = guess;
  while (count(many) < phyxels) many *= 0.7;
  if (count(few) >= phyxels) return few;
  while (few - many > 1e-12 * many) {
    const double middle = 0.5 * (few + many);
    (count(middle) < phyxels ? few : many) = middle;
  }
  return phyxels - count(few) < count(many) - phyxels ? few : many;
}

std::string objection_to_placement(const ShapeRequest& request) {
  using Placement = ShapeRequest::Placement;
  const bool is_sphere = request.name == "sphere";
  if (is_sphere && request.placement == Placement::nodes) {
    return "\"nodes\" found with shape = \"sphere\", on whose round surface its outer layer would "
           "not lie; allowed: \"fitted\" or \"cells\", or the shapes beam, block and cylinder";
  }
  if (request.placement != Placement::fitted) return {};
  const char* lattices = is_sphere ? "\"cells\"" : "\"nodes\" or \"cells\"";
  if (request.jitter > 0) {
    return fmt::format(
        "\"fitted\" found with jitter = {:g}, which moves phyxels of a lattice; allowed: {}, or "
        "jitter = 0",
        request.jitter, lattices);
  }
  if (!request.surface) {
    return fmt::format(
        "\"fitted\" found with surfels = false, though its phyxels are laid along the surface; "
        "allowed: {}, or surfels = true",
        lattices);
  }
  return {};
}

ShapeRequest::Placement best_placement(const ShapeRequest& request, bool closed) {
  using Placement = ShapeRequest::Placement;
  check_spacing(request);
  const Lattice lattice = make_lattice(request, request.spacing);
  const Vec3d& size = lattice.extent;
  const double thinnest = std::min({size.x, size.y, size.z});
  const bool is_box = lattice.solid == Lattice::Solid::box;
  const bool layers_do =
      is_box && !request.grading &&
      std::ranges::all_of(request.supports, is_along_axes, &SupportRegion::region);
  if (closed && !layers_do && request.surface && request.jitter == 0 &&
      thinnest > 3 * request.spacing) {
    return Placement::fitted;
  }
  const double between_faces = is_box ? thinnest : size.z;
  return lattice.solid != Lattice::Solid::sphere && between_faces > 0.999 * request.spacing
             ? Placement::nodes
             : Placement::cells;
}

Cloud make_shape(const ShapeRequest& request) {
  check_name(request.name);
  if (const PaperBody* body = find_paper_body(request.name)) {
    Cloud cloud = make_paper_body(*body, request.surface);
    cloud.lattice = true;
    return cloud;
  }
  if (request.placement == ShapeRequest::Placement::fitted) return make_fitted_shape(request);
  return make_lattice_shape(request).cloud;
}

CloudPiece make_lattice_shape(const ShapeRequest& request, Piece piece) {
  check_request(request);
  const Lattice lattice = make_lattice(request, request.spacing);
  require_memory_for_cloud(request.name, lattice.phyxels(), piece);
  CloudPiece made = fill_lattice(lattice, request.jitter, request.seed, piece);
  if (request.surface) made.cloud.surface = lattice_surface(lattice, request.spacing);
  made.cloud.lattice = request.jitter == 0;
  made.cloud.cuts.depth = lattice.depth;
  made.cloud.cuts.spacing = request.spacing;
  for (const LatticeRoom& room : lattice.rooms) made.cloud.cuts.list.push_back(room.cut);
  made.cloud.cuts.moved = lattice.moved;
  return made;
}

}  // namespace phyxel
