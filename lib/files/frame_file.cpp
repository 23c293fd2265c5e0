#include "files/frame_file.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/error.hpp"
#include "version.hpp"

namespace phyxel {
namespace {

constexpr std::uint8_t vtk_poly_vertex = 2, vtk_triangle = 5;
constexpr std::int64_t version = 1;

/// Bodies are told apart by an array of their own only where there are several.
bool wants(const Scene& scene, const char* field) {
  return std::find(scene.output.fields.begin(), scene.output.fields.end(), field) !=
         scene.output.fields.end();
}

/// The run's own metadata, beside the VTKHDF group.
void write_metadata(Hdf5Writer& out, const Scene& scene, const Frame& frame) {
  out.group("/phyxel");
  out.attribute("/phyxel", "version", version);
  out.attribute("/phyxel", "program", program_version());
  out.attribute("/phyxel", "title", scene.title);
  out.attribute("/phyxel", "step", frame.diagnostics.step);
  out.attribute("/phyxel", "units", std::string("SI: m, m/s, Pa, kg, s, J"));
  for (const DiagnosticColumn& column : diagnostic_columns()) {
    out.attribute("/phyxel", column.name, column.value(frame.diagnostics));
  }
  out.text("/phyxel/scene", scene.text);
}

void write_grid(Hdf5Writer& out, std::span<const Vec3d> points, bool as_float,
                std::span<const std::int64_t> connectivity, std::span<const std::int64_t> offsets,
                std::uint8_t cell_type) {
  out.group("/VTKHDF");
  const std::int64_t vtkhdf[] = {1, 0};
  out.attribute("/VTKHDF", "Version", std::span<const std::int64_t>(vtkhdf));
  out.attribute("/VTKHDF", "Type", std::string("UnstructuredGrid"));
  const auto count = [&](const char* name, std::size_t value) {
    const auto number = static_cast<std::int64_t>(value);
    out.array<std::int64_t>(name, std::span(&number, 1));
  };
  const std::size_t cells = offsets.size() - 1;
  count("/VTKHDF/NumberOfPoints", points.size());
  count("/VTKHDF/NumberOfCells", cells);
  count("/VTKHDF/NumberOfConnectivityIds", connectivity.size());
  out.vectors("/VTKHDF/Points", points, as_float);
  out.array<std::uint8_t>("/VTKHDF/Types", std::vector<std::uint8_t>(cells, cell_type));
  out.array<std::int64_t>("/VTKHDF/Connectivity", connectivity);
  out.array<std::int64_t>("/VTKHDF/Offsets", offsets);
  out.group("/VTKHDF/PointData");
}

void write_scalars(Hdf5Writer& out, const char* path, std::span<const double> values) {
  out.array<float>(path, std::vector<float>(values.begin(), values.end()));
}

}  // namespace

std::span<const DiagnosticColumn> diagnostic_columns() {
  using D = const Diagnostics&;
  static const DiagnosticColumn columns[] = {
      {"time", "s", [](D d) { return d.time; }},
      {"kinetic_energy", "J", [](D d) { return d.kinetic_energy; }},
      {"strain_energy", "J", [](D d) { return d.strain_energy; }},
      {"volume_energy", "J", [](D d) { return d.volume_energy; }},
      {"gravity_energy", "J", [](D d) { return d.gravity_energy; }},
      {"load_energy", "J", [](D d) { return d.load_energy; }},
      {"total_energy", "J", [](D d) { return d.total_energy(); }},
      {"momentum_x", "kg m/s", [](D d) { return d.momentum.x; }},
      {"momentum_y", "kg m/s", [](D d) { return d.momentum.y; }},
      {"momentum_z", "kg m/s", [](D d) { return d.momentum.z; }},
      {"angular_momentum_x", "kg m^2/s", [](D d) { return d.angular_momentum.x; }},
      {"angular_momentum_y", "kg m^2/s", [](D d) { return d.angular_momentum.y; }},
      {"angular_momentum_z", "kg m^2/s", [](D d) { return d.angular_momentum.z; }},
      {"internal_force", "N", [](D d) { return norm(d.internal_force); }},
      {"internal_torque", "N m", [](D d) { return norm(d.internal_torque); }},
      {"largest_displacement", "m", [](D d) { return d.largest_displacement; }},
      {"largest_speed", "m/s", [](D d) { return d.largest_speed; }},
      {"inverted_phyxels", "1", [](D d) { return static_cast<double>(d.inverted); }},
  };
  return columns;
}

void write_phyxel_frame(const std::filesystem::path& file, const Model& model, const Scene& scene,
                        const Frame& frame) {
  const bool as_float = scene.solver.precision == Precision::single;
  const State& state = *frame.state;
  const auto n = static_cast<std::size_t>(model.size());
  std::vector<Vec3d> points(n);
  std::vector<std::int64_t> connectivity(n), offsets{0};
  for (std::size_t i = 0; i < n; ++i) {
    points[i] = model.position[i] + state.displacement[i];
    connectivity[i] = static_cast<std::int64_t>(i);
  }
  for (const Part& part : model.parts) offsets.push_back(part.end);

  Hdf5Writer out;
  write_grid(out, points, as_float, connectivity, offsets, vtk_poly_vertex);
  const std::string data = "/VTKHDF/PointData/";
  if (wants(scene, "displacement"))
    out.vectors(data + "displacement", state.displacement, as_float);
  if (wants(scene, "velocity")) out.vectors(data + "velocity", state.velocity, as_float);
  if (!frame.von_mises.empty()) write_scalars(out, "/VTKHDF/PointData/von_mises", frame.von_mises);
  if (!frame.volume_ratio.empty())
    write_scalars(out, "/VTKHDF/PointData/volume_ratio", frame.volume_ratio);
  if (wants(scene, "mass")) write_scalars(out, "/VTKHDF/PointData/mass", model.mass);
  if (wants(scene, "volume")) write_scalars(out, "/VTKHDF/PointData/volume", model.volume);
  if (model.parts.size() > 1 || wants(scene, "body")) {
    std::vector<Index> body(n);
    for (std::size_t p = 0; p < model.parts.size(); ++p) {
      std::fill(body.begin() + model.parts[p].begin, body.begin() + model.parts[p].end,
                static_cast<Index>(p));
    }
    out.array<Index>(data + "body", body);
  }
  write_metadata(out, scene, frame);
  write_sealed(file, phyxel_frame_kind, out.image(), Durable::no);
}

void write_surface_frame(const std::filesystem::path& file, const Model& model, const Scene& scene,
                         const Frame& frame) {
  const bool as_float = scene.solver.precision == Precision::single;
  const auto& triangles = model.surfels.triangle;
  std::vector<std::int64_t> connectivity, offsets{0};
  connectivity.reserve(3 * triangles.size());
  offsets.reserve(triangles.size() + 1);
  for (const Triangle& triangle : triangles) {
    connectivity.insert(connectivity.end(), triangle.begin(), triangle.end());
    offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
  }
  Hdf5Writer out;
  write_grid(out, frame.surfels->position, as_float, connectivity, offsets, vtk_triangle);
  out.vectors("/VTKHDF/PointData/Normals", frame.surfels->normal, true);
  if (model.parts.size() > 1) {
    std::vector<Index> body(frame.surfels->position.size());
    for (std::size_t p = 0; p < model.parts.size(); ++p) {
      std::fill(body.begin() + model.parts[p].surfel_begin,
                body.begin() + model.parts[p].surfel_end, static_cast<Index>(p));
    }
    out.array<Index>("/VTKHDF/PointData/body", body);
  }
  write_metadata(out, scene, frame);
  write_sealed(file, surface_frame_kind, out.image(), Durable::no);
}

FrameData read_frame(const std::filesystem::path& file) {
  const std::string kind = check_seal(file);
  if (kind != phyxel_frame_kind && kind != surface_frame_kind) {
    throw InputError(
        fmt::format("{}: is a phyxel {}; expected a frame of a trajectory", file.string(), kind));
  }
  const Hdf5Reader in(file);
  if (const std::int64_t found = in.integer_attribute("/phyxel", "version"); found != version) {
    in.refuse(fmt::format("format version {}; this program reads version {}", found, version));
  }
  FrameData frame;
  frame.time = in.number_attribute("/phyxel", "time");
  frame.point = in.vectors("/VTKHDF/Points");
  for (std::size_t i = 0; i < frame.point.size(); ++i) {
    if (!is_finite(frame.point[i]))
      in.refuse(fmt::format("/VTKHDF/Points is not finite in row {}", i));
  }
  const auto fits = [&](const char* path, std::size_t rows) {
    if (rows != frame.point.size()) {
      in.refuse(fmt::format("{} has {} rows, /VTKHDF/Points {}", path, rows, frame.point.size()));
    }
  };
  if (in.has("/VTKHDF/PointData/Normals")) {
    frame.normal = in.vectors("/VTKHDF/PointData/Normals");
    fits("/VTKHDF/PointData/Normals", frame.normal.size());
  }
  if (in.has("/VTKHDF/PointData/body")) {
    frame.body = in.array<Index>("/VTKHDF/PointData/body");
    fits("/VTKHDF/PointData/body", frame.body.size());
  }
  if (kind == surface_frame_kind) {
    const auto corners = in.array<std::int64_t>("/VTKHDF/Connectivity");
    if (corners.size() % 3 != 0) in.refuse("/VTKHDF/Connectivity does not hold triangles");
    frame.triangle.resize(corners.size() / 3);
    for (std::size_t c = 0; c < corners.size(); ++c) {
      if (corners[c] < 0 || corners[c] >= static_cast<std::int64_t>(frame.point.size())) {
        in.refuse(fmt::format("/VTKHDF/Connectivity holds the index {}; allowed 0 to {}",
                              corners[c], static_cast<std::int64_t>(frame.point.size()) - 1));
      }
      frame.triangle[c / 3][c % 3] = static_cast<Index>(corners[c]);
    }
  }
  return frame;
}

}  // namespace phyxel
