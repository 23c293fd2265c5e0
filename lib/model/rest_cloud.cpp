#include <fmt/format.h>

#include "model/assembly.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "scene/scene_error.hpp"
#include "shapes/lattice_shapes.hpp"
#include "stage.hpp"

namespace phyxel {

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
    std::optional<Grading> grading = source.grading;
    if (grading) grading->finer = from.finer;
    try {
      SampleReport report;
      Cloud cloud = sample_surface(surface,
                                   {.phyxels = source.phyxels,
                                    .seed = source.seed,
                                    .relaxations = source.relaxations,
                                    .on_surface = source.on_surface,
                                    .cuts = from.cuts,
                                    .grading = grading},
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
  return in_stage("making the shape", [&] {
    const std::optional<ShapeRequest> lattice = lattice_of(source, {});
    return make_shape(lattice ? *lattice : source.shape);
  });
}

std::optional<ShapeRequest> lattice_of(const BodySource& source, Piece piece) {
  if (source.shape.name.empty() || is_paper_shape(source.shape.name)) return {};
  ShapeRequest shape = source.shape;
  shape.seed = source.seed;
  if (shape.spacing == 0) shape.spacing = spacing_for(shape, source.phyxels, piece);
  return shape;
}

Cloud make_cloud(const BodyRequest& request) {
  Cloud cloud = naming(request, [&] { return rest_cloud(source_of(request)); });
  place(cloud, request);
  return cloud;
}

}  // namespace phyxel
