/// Export of a trajectory to one temporal VTKHDF file.
#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "files/atomic_file.hpp"
#include "files/frame_file.hpp"
#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"
#include "version.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

const std::string grid = "/VTKHDF/";
const std::string point_data = "/VTKHDF/PointData/";

/// An array of a frame, with its type and its number of columns.
struct Field {
  std::string name;
  bool integer = false;
  std::size_t columns = 0;
};

/// Adds an array that concatenates the rows of the frames. Each frame is read when it is written.
template <class T>
void gather(Hdf5Writer& out, const std::string& path, const std::vector<SeriesEntry>& entries,
            std::size_t points, std::size_t columns) {
  out.later<T>(
      path, entries.size() * points, columns, points,
      [=, &entries](std::size_t first, std::span<T> values) {
        const SeriesEntry& entry = entries[first / points];
        const std::vector<T> read = Hdf5Reader(entry.file).array<T>(path, columns);
        if (read.size() != values.size()) {
          throw InputError(fmt::format("{}: changed while it was read", entry.file.string()));
        }
        std::copy(read.begin(), read.end(), values.begin());
      });
}

void put(Hdf5Writer& out, const std::string& path, const std::vector<std::int64_t>& values,
         std::size_t columns) {
  out.array<std::int64_t>(path, values, columns);
}

}  // namespace

void export_single(const fs::path& series, const fs::path& out_file, bool overwrite) {
  const std::vector<SeriesEntry> entries = read_series(series);
  if (entries.empty()) throw InputError(fmt::format("{}: lists no frames", series.string()));
  check_output_file(out_file, overwrite, Output::file);
  make_writable_folder(out_file.has_parent_path() ? out_file.parent_path() : ".");

  const std::string kind = check_seal(entries.front().file);
  if (kind != phyxel_frame_kind && kind != surface_frame_kind) {
    throw InputError(
        fmt::format("{}: is a phyxel {}; expected a frame", entries.front().file.string(), kind));
  }
  const Hdf5Reader first(entries.front().file);
  const std::size_t steps = entries.size();
  const std::size_t points = first.shape(grid + "Points").rows;
  const auto connectivity = first.array<std::int64_t>(grid + "Connectivity");
  const auto offsets = first.array<std::int64_t>(grid + "Offsets");
  std::vector<Field> fields;
  for (const std::string& name : first.names("/VTKHDF/PointData")) {
    fields.push_back(
        {name, first.is_integer(point_data + name), first.shape(point_data + name).columns});
  }

  bool floats_do = true;
  std::vector<double> times;
  std::vector<std::int64_t> point_offsets;
  for (const SeriesEntry& entry : entries) {
    check_seal(entry.file, kind);
    const Hdf5Reader in(entry.file);
    if (in.shape(grid + "Points").rows != points ||
        in.array<std::int64_t>(grid + "Connectivity") != connectivity) {
      in.refuse("has other points or cells than the first frame of its series");
    }
    floats_do = floats_do && !in.has_attribute("/phyxel", far_attribute);
    point_offsets.push_back(static_cast<std::int64_t>(times.size() * points));
    times.push_back(entry.time);
  }

  // In memory except for the concatenated arrays, so that HDF5 never writes to a full disk.
  Hdf5Writer out;
  out.group("/VTKHDF");
  const std::int64_t version[] = {2, 0};
  out.attribute("/VTKHDF", "Version", std::span<const std::int64_t>(version));
  out.attribute("/VTKHDF", "Type", std::string("UnstructuredGrid"));
  put(out, grid + "NumberOfPoints", {static_cast<std::int64_t>(points)}, 0);
  put(out, grid + "NumberOfCells", {static_cast<std::int64_t>(offsets.size()) - 1}, 0);
  put(out, grid + "NumberOfConnectivityIds", {static_cast<std::int64_t>(connectivity.size())}, 0);
  out.array<std::uint8_t>(grid + "Types", first.array<std::uint8_t>(grid + "Types"));
  put(out, grid + "Connectivity", connectivity, 0);
  put(out, grid + "Offsets", offsets, 0);
  const auto gather_reals = [&](const std::string& path, std::size_t columns, bool as_float) {
    (as_float ? gather<float> : gather<double>)(out, path, entries, points, columns);
  };
  gather_reals(grid + "Points", 3, floats_do);
  for (const Field& field : fields) {
    if (field.integer) {
      gather<Index>(out, point_data + field.name, entries, points, field.columns);
    } else {
      gather_reals(point_data + field.name, field.columns,
                   floats_do || field.name != "displacement");
    }
  }
  out.group("/phyxel");
  out.attribute("/phyxel", "version", std::int64_t{1});
  out.attribute("/phyxel", "program", program_version());
  out.attribute("/phyxel", "title", first.text_attribute("/phyxel", "title"));
  out.text("/phyxel/scene", first.text("/phyxel/scene"));

  // Parts, cells and connectivity are the same in every step, and are stored once.
  const std::vector<std::int64_t> zeros(steps, 0), ones(steps, 1);
  out.group("/VTKHDF/Steps");
  out.attribute("/VTKHDF/Steps", "NSteps", static_cast<std::int64_t>(steps));
  out.array<double>(grid + "Steps/Values", times);
  put(out, grid + "Steps/PartOffsets", zeros, 0);
  put(out, grid + "Steps/NumberOfParts", ones, 0);
  put(out, grid + "Steps/PointOffsets", point_offsets, 0);
  put(out, grid + "Steps/CellOffsets", zeros, 1);
  put(out, grid + "Steps/ConnectivityIdOffsets", zeros, 1);
  out.group("/VTKHDF/Steps/PointDataOffsets");
  for (const Field& field : fields)
    put(out, grid + "Steps/PointDataOffsets/" + field.name, point_offsets, 0);
  write_sealed(out_file, "trajectory", out.content(), Durable::yes);
}

}  // namespace phyxel
