#include "files/frame_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/history.hpp"
#include "version.hpp"

namespace phyxel {
namespace {

constexpr std::uint8_t vtk_poly_vertex = 2, vtk_triangle = 5;
constexpr std::int64_t version = 1;

/// Writes the run's metadata, in the group /phyxel beside the VTKHDF group.
void write_metadata(Hdf5Writer& out, const Scene& scene, const Diagnostics& diagnostics,
                    bool floats_do) {
  out.group("/phyxel");
  out.attribute("/phyxel", "version", version);
  out.attribute("/phyxel", "program", program_version());
  out.attribute("/phyxel", "title", scene.title);
  out.attribute("/phyxel", "step", diagnostics.step);
  out.attribute("/phyxel", "units", std::string("SI: m, m/s, Pa, kg, s, J"));
  for (const DiagnosticColumn& column : diagnostic_columns()) {
    out.attribute("/phyxel", column.name, column.value(diagnostics));
  }
  if (!floats_do) out.attribute("/phyxel", far_attribute, std::int64_t{1});
  out.text("/phyxel/scene", scene.text);
}

/// The end of each body's phyxels, or surfels, in global ids.
struct Ends {
  std::vector<std::int64_t> phyxels, surfels;
};
Ends ends_of(const Model& model) {
  Ends ends;
  std::int64_t phyxels = 0, surfels = 0;
  for (const Part& part : model.parts) {
    const auto bodies = static_cast<std::size_t>(part.body) + 1;
    ends.phyxels.resize(bodies);
    ends.surfels.resize(bodies);
    ends.phyxels.back() = phyxels = model.share ? phyxels + part.size : part.end;
    ends.surfels.back() = surfels = model.share ? surfels + part.surfels : part.surfel_end;
  }
  return ends;
}

void write_counts(Hdf5Writer& out, std::int64_t points, std::int64_t cells,
                  std::int64_t connectivity) {
  out.group("/VTKHDF");
  const std::int64_t vtkhdf[] = {1, 0};
  out.attribute("/VTKHDF", "Version", std::span<const std::int64_t>(vtkhdf));
  out.attribute("/VTKHDF", "Type", std::string("UnstructuredGrid"));
  const auto count = [&](const char* name, std::int64_t value) {
    out.array<std::int64_t>(name, std::span<const std::int64_t>(&value, 1));
  };
  count("/VTKHDF/NumberOfPoints", points);
  count("/VTKHDF/NumberOfCells", cells);
  count("/VTKHDF/NumberOfConnectivityIds", connectivity);
}

/// Rows of an array, in the type in which the file stores them.
template <class T>
Hdf5Writer::Fill<T> rows_of(const FileArray& array, ChunkedSource& values) {
  return [array, &values](std::size_t first, std::span<T> rows) {
    const auto begin = static_cast<Index>(first);
    const Index end = begin + static_cast<Index>(rows.size() / width_of(array.terms[0]));
    const std::vector<double> sum = sum_of_terms(array, [&](Quantity term) {
      const std::span<const double> found = values.values(term, begin, end);
      if (found.size() == rows.size()) return found;
      throw InputError(fmt::format("{}: the source has {} numbers for rows {} to {}; allowed: {}",
                                   array.path, found.size(), begin, end, rows.size()));
    });
    std::transform(sum.begin(), sum.end(), rows.begin(),
                   [](double value) { return static_cast<T>(value); });
  };
}

template <class T>
void write_rows(Hdf5Writer& out, const FileArray& array, ChunkedSource& values) {
  const std::size_t width = width_of(array.terms[0]), columns = width > 1 ? width : 0;
  const auto rows = static_cast<std::size_t>(array.count);
  if (values.writes_collectively(array.count)) {
    out.collectively<T>(array.path, rows, columns,
                        [array, &values](const std::filesystem::path& file) {
                          values.write_collectively(file, array);
                        });
  } else {
    out.later<T>(array.path, rows, columns, static_cast<std::size_t>(values.length()),
                 rows_of<T>(array, values));
  }
}

/// Typical distance between two points of a part [m], from its volume v: (v/n)^(1/3) for n phyxels;
/// for n surfels that on a sphere of volume v, which has the smallest surface.
double spacing_of(const Part& part, Points points) {
  if (points == Points::phyxels) return std::cbrt(part.volume / std::max(1, part.size));
  const double area = std::cbrt(36 * std::numbers::pi * part.volume * part.volume);
  return std::sqrt(area / std::max(1, part.surfels));
}

/// The sequence 0, `step`, 2 `step`, ...
Hdf5Writer::Fill<std::int64_t> counting(std::int64_t step) {
  return [step](std::size_t first, std::span<std::int64_t> rows) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      rows[k] = step * static_cast<std::int64_t>(first + k);
    }
  };
}

/// The index of the body of each phyxel, or surfel.
Hdf5Writer::Fill<Index> bodies(std::vector<std::int64_t> ends) {
  return [ends = std::move(ends)](std::size_t first, std::span<Index> rows) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const auto number = static_cast<std::int64_t>(first + k);
      rows[k] =
          static_cast<Index>(std::upper_bound(ends.begin(), ends.end(), number) - ends.begin());
    }
  };
}

/// Calls use(name, quantity) for the computed fields and for what the materials of a scene
/// remember, if frames hold it.
template <class Use>
void for_each_found_field(const Model& model, const Scene& scene, Use&& use) {
  for (const PointField& computed : point_fields()) use(computed.name, computed.quantity);
  if (!scene.output.wants("history")) return;
  const std::vector<std::string> columns = history_columns(model);
  for (std::size_t k = 0; k < columns.size(); ++k) use(columns[k].c_str(), history_quantity(k));
}

}  // namespace

bool floats_hold_positions(const Model& model, double displacement, Points points) {
  constexpr double share = 1e-3, epsilon = std::numeric_limits<float>::epsilon();
  return std::all_of(model.parts.begin(), model.parts.end(), [&](const Part& part) {
    if (points == Points::surfels && part.surfels == 0) return true;
    return epsilon * (part.farthest + displacement) <= share * spacing_of(part, points);
  });
}

void write_later(Hdf5Writer& out, const FileArray& array, ChunkedSource& values) {
  if (array.as_float) return write_rows<float>(out, array, values);
  write_rows<double>(out, array, values);
}

std::span<const DiagnosticColumn> diagnostic_columns() {
  using D = const Diagnostics&;
  static const DiagnosticColumn columns[] = {
      {"time", "s", [](D d) { return d.time; }},
      {"kinetic_energy", "J", [](D d) { return d.kinetic_energy; }},
      {"strain_energy", "J", [](D d) { return d.strain_energy; }},
      {"volume_energy", "J", [](D d) { return d.volume_energy; }},
      {"hourglass_energy", "J", [](D d) { return d.hourglass_energy; }},
      {"plastic_work", "J", [](D d) { return d.plastic_work; }},
      {"viscous_work", "J", [](D d) { return d.viscous_work; }},
      {"contact_loss", "J", [](D d) { return d.contact_loss; }},
      {"contact_energy", "J", [](D d) { return d.contact_energy; }},
      {"fracture_energy", "J", [](D d) { return d.fracture_energy; }},
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
                        const Diagnostics& diagnostics, ChunkedSource& values) {
  const bool as_float = scene.solver.precision == Precision::single;
  const bool floats_do =
      floats_hold_positions(model, diagnostics.largest_displacement, Points::phyxels);
  const Index n = model.global_count();
  const auto rows = static_cast<std::size_t>(n),
             stretch = static_cast<std::size_t>(values.length());
  const Ends ends = ends_of(model);
  std::vector<std::int64_t> offsets{0};
  offsets.insert(offsets.end(), ends.phyxels.begin(), ends.phyxels.end());
  const std::size_t cells = ends.phyxels.size();

  Hdf5Writer out;
  write_counts(out, n, static_cast<std::int64_t>(cells), n);
  write_later(
      out,
      {"/VTKHDF/Points", as_float && floats_do, n, {Quantity::position, Quantity::displacement}},
      values);
  out.array<std::uint8_t>("/VTKHDF/Types", std::vector<std::uint8_t>(cells, vtk_poly_vertex));
  out.later<std::int64_t>("/VTKHDF/Connectivity", rows, 0, stretch, counting(1));
  out.array<std::int64_t>("/VTKHDF/Offsets", offsets);
  out.group("/VTKHDF/PointData");
  const auto field = [&](const char* name, bool in_float, Quantity quantity) {
    write_later(out, {std::string("/VTKHDF/PointData/") + name, in_float, n, {quantity}}, values);
  };
  if (scene.output.wants("displacement")) field("displacement", as_float, Quantity::displacement);
  if (scene.output.wants("velocity")) field("velocity", as_float, Quantity::velocity);
  for_each_found_field(model, scene, [&](const char* name, Quantity quantity) {
    if (is_history(quantity) || values.has(quantity)) field(name, true, quantity);
  });
  if (scene.output.wants("mass")) field("mass", true, Quantity::mass);
  if (scene.output.wants("volume")) field("volume", true, Quantity::volume);
  if (cells > 1 || scene.output.wants("body")) {
    out.later<Index>("/VTKHDF/PointData/body", rows, 0, stretch, bodies(ends.phyxels));
  }
  write_metadata(out, scene, diagnostics, floats_do);
  write_sealed(file, phyxel_frame_kind, out.content(), Durable::no);
}

void write_surface_frame(const std::filesystem::path& file, const Model& model, const Scene& scene,
                         const Diagnostics& diagnostics, ChunkedSource& values) {
  const bool floats_do =
      floats_hold_positions(model, diagnostics.largest_displacement, Points::surfels);
  const Ends ends = ends_of(model);
  const std::int64_t points = ends.surfels.empty() ? 0 : ends.surfels.back();
  const auto rows = static_cast<std::size_t>(points);
  const auto stretch = static_cast<std::size_t>(values.length());
  const std::span<const Triangle> triangles = values.triangles();
  const std::size_t cells = triangles.size();

  Hdf5Writer out;
  write_counts(out, points, static_cast<std::int64_t>(cells), static_cast<std::int64_t>(3 * cells));
  const auto vectors = [&](const char* path, bool as_float, Quantity quantity) {
    write_later(out, {path, as_float, static_cast<Index>(points), {quantity}}, values);
  };
  const bool in_float = scene.solver.precision == Precision::single;
  vectors("/VTKHDF/Points", in_float && floats_do, Quantity::surfel_position);
  out.later<std::uint8_t>("/VTKHDF/Types", cells, 0, stretch,
                          [](std::size_t, std::span<std::uint8_t> types) {
                            std::fill(types.begin(), types.end(), vtk_triangle);
                          });
  out.later<std::int64_t>("/VTKHDF/Connectivity", 3 * cells, 0, stretch,
                          [triangles](std::size_t first, std::span<std::int64_t> corners) {
                            for (std::size_t k = 0; k < corners.size(); ++k) {
                              corners[k] = triangles[(first + k) / 3][(first + k) % 3];
                            }
                          });
  out.later<std::int64_t>("/VTKHDF/Offsets", cells + 1, 0, stretch, counting(3));
  out.group("/VTKHDF/PointData");
  vectors("/VTKHDF/PointData/Normals", true, Quantity::surfel_normal);
  const auto field = [&](const char* name, bool as_float, Quantity quantity) {
    if (!values.has(on_surface(quantity))) return;
    vectors((std::string("/VTKHDF/PointData/") + name).c_str(), as_float, on_surface(quantity));
  };
  field("displacement", in_float, Quantity::displacement);
  field("velocity", in_float, Quantity::velocity);
  for_each_found_field(model, scene,
                       [&](const char* name, Quantity quantity) { field(name, true, quantity); });
  if (ends.surfels.size() > 1 || scene.output.wants("body")) {
    out.later<Index>("/VTKHDF/PointData/body", rows, 0, stretch, bodies(ends.surfels));
  }
  write_metadata(out, scene, diagnostics, floats_do);
  write_sealed(file, surface_frame_kind, out.content(), Durable::no);
}

FrameData read_frame(const std::filesystem::path& file, bool with_fields) {
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
  if (!std::isfinite(frame.time)) in.refuse(fmt::format("has the time {} s", frame.time));
  const std::size_t points = in.shape("/VTKHDF/Points").rows;
  if (points > static_cast<std::size_t>(std::numeric_limits<Index>::max())) {
    in.refuse(fmt::format("/VTKHDF/Points has {} rows; allowed at most {}", points,
                          std::numeric_limits<Index>::max()));
  }
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
  if (with_fields) {
    frame.program = in.text_attribute("/phyxel", "program");
    frame.title = in.text_attribute("/phyxel", "title");
    frame.scene = in.text("/phyxel/scene");
    const auto field = [&](const char* name, std::size_t columns) {
      const std::string path = std::string("/VTKHDF/PointData/") + name;
      if (!in.has(path)) return;
      std::vector<double> values = in.array<double>(path, columns);
      fits(path.c_str(), values.size() / std::max<std::size_t>(1, columns));
      frame.field[name] = std::move(values);
    };
    for (const char* name : {"displacement", "velocity"}) field(name, 3);
    for (const PointField& computed : point_fields()) {
      const std::size_t width = width_of(computed.quantity);
      field(computed.name, width > 1 ? width : 0);
    }
    for (const char* name : {"mass", "volume"}) field(name, 0);
    for (const std::string& name : in.members("/VTKHDF/PointData")) {  // what laws remember
      const std::string path = "/VTKHDF/PointData/" + name;
      if (name != "body" && frame.field.count(name) == 0 && in.shape(path).columns == 0) {
        field(name.c_str(), 0);
      }
    }
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
