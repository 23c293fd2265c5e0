#include <fmt/format.h>

#include "model/assembly.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "scene/scene_error.hpp"
#include "shapes/lattice_shapes.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// The grading of a source, with its finer regions.
std::optional<Grading> grading_of(const CutSource& from) {
  std::optional<Grading> grading = from.source.grading;
  if (grading) grading->finer = from.finer;
  return grading;
}

/// True of lattices so far from the origin that coordinates do not tell a layer from the face that
/// it lies on. @param spacing [m]
bool is_lattice_far(const CutSource& from, double spacing) {
  return is_lattice(from.source) && from.shift > 1e8 * spacing;
}

/// The request of a shape that is no body of the paper's. @param piece that is to be made
ShapeRequest shape_of(const CutSource& from, Piece piece) {
  ShapeRequest shape = from.source.shape;
  shape.seed = from.source.seed;
  shape.supports = from.supports;
  shape.grading = grading_of(from);
  if (shape.spacing == 0) shape.spacing = spacing_for(shape, from.source.phyxels, piece);
  if (is_lattice_far(from, shape.spacing)) shape.supports.clear();
  return shape;
}

}  // namespace

Cloud rest_cloud(const CutSource& from) {
  const BodySource& source = from.source;
  if (!source.file.empty()) return read_body(source.file);
  if (!source.cloud.empty()) {
    throw InputError(fmt::format(
        "cloud = \"{}\": only a program that has a cloud of that name can use this scene; allowed "
        "here: shape, mesh or file",
        source.cloud));
  }
  if (!source.mesh.empty()) {
    const Surface surface = read_mesh(source.mesh);
    try {
      SampleReport report;
      Cloud cloud = sample_surface(surface,
                                   {.phyxels = source.phyxels,
                                    .seed = source.seed,
                                    .relaxations = source.relaxations,
                                    .on_surface = source.on_surface,
                                    .cuts = regions_of(from.supports),
                                    .grading = grading_of(from)},
                                   &report);
      cloud.cuts.shift = from.shift;
      for (const std::string& warning : report.warnings) {
        cloud.warnings.push_back(fmt::format("{}: {}", source.mesh.string(), warning));
      }
      return cloud;
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", source.mesh.string(), error.what()));
    }
  }
  if (source.shape.placement == ShapeRequest::Placement::fitted) {  // it has stages of its own
    Cloud cloud = make_shape(shape_of(from, {}));
    cloud.cuts.shift = from.shift;
    return cloud;
  }
  return in_stage("making the shape", [&] {
    return is_lattice(source) ? lattice_piece(from).cloud : make_shape(source.shape);
  });
}

bool is_lattice(const BodySource& source) {
  return !source.shape.name.empty() && !is_paper_shape(source.shape.name) &&
         source.shape.placement != ShapeRequest::Placement::fitted;
}

bool has_rooms(const CutSource& from) {
  if (from.supports.empty()) return false;
  if (!is_lattice(from.source)) return true;
  const ShapeRequest shape = shape_of(from, {});
  return !make_lattice(shape, shape.spacing).rooms.empty();
}

CloudPiece lattice_piece(const CutSource& from, Piece piece) {
  const ShapeRequest shape = shape_of(from, piece);
  CloudPiece made = make_lattice_shape(shape, piece);
  made.cloud.cuts.shift = from.shift;
  if (is_lattice_far(from, shape.spacing) && !from.supports.empty()) {
    made.cloud.warnings.push_back(fmt::format(
        "shape \"{}\": supports end with the phyxels whose centres lie in them, not where they are "
        "asked to, as the body lies more than 1e8 spacings of {:.4g} m from the origin; nearer to "
        "it they act where they end",
        shape.name, shape.spacing));
  }
  return made;
}

Cloud make_cloud(const BodyRequest& request) {
  Cloud cloud = naming(request, [&] { return rest_cloud(source_of(request)); });
  place(cloud, request);
  return cloud;
}

}  // namespace phyxel
