/// A whole trajectory in one temporal VTKHDF file.
#include <fmt/format.h>
#include <unistd.h>

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

/// An array of a frame with the type and the width it has there.
struct Field {
  std::string name;
  bool integer = false;
  std::size_t columns = 0;
};

/// Removes a half-written file unless told that it is finished.
class Unfinished {
 public:
  explicit Unfinished(fs::path file) : file_(std::move(file)) {}
  ~Unfinished() {
    std::error_code ignored;
    if (!file_.empty()) fs::remove(file_, ignored);
  }
  void finished() { file_.clear(); }

 private:
  fs::path file_;
};

void copy_field(const Hdf5Reader& in, const Field& field, Hdf5Writer& out, std::size_t first) {
  const std::string path = point_data + field.name;
  if (field.integer) {
    out.rows<Index>(path, first, in.array<Index>(path, field.columns), field.columns);
  } else {
    out.rows<float>(path, first, in.array<float>(path, field.columns), field.columns);
  }
}

void put(Hdf5Writer& out, const std::string& path, const std::vector<std::int64_t>& values,
         std::size_t columns) {
  out.array<std::int64_t>(path, values, columns);
}

}  // namespace

void export_single(const fs::path& series, const fs::path& out_file, bool overwrite) {
  const std::vector<SeriesEntry> entries = read_series(series);
  if (entries.empty()) throw InputError(fmt::format("{}: lists no frames", series.string()));
  if (!overwrite && fs::exists(out_file)) {
    throw InputError(
        fmt::format("{}: exists already and is kept; --force replaces it", out_file.string()));
  }
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

  const fs::path temporary = out_file.string() + ".tmp";
  Unfinished guard(temporary);
  Hdf5Writer out(temporary);
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
  out.reserve<float>(grid + "Points", steps * points, 3);
  for (const Field& field : fields) {
    if (field.integer) {
      out.reserve<Index>(point_data + field.name, steps * points, field.columns);
    } else {
      out.reserve<float>(point_data + field.name, steps * points, field.columns);
    }
  }
  out.group("/phyxel");
  out.attribute("/phyxel", "version", std::int64_t{1});
  out.attribute("/phyxel", "program", program_version());
  out.attribute("/phyxel", "title", first.text_attribute("/phyxel", "title"));
  out.text("/phyxel/scene", first.text("/phyxel/scene"));

  std::vector<double> times;
  std::vector<std::int64_t> point_offsets;
  for (const SeriesEntry& entry : entries) {
    check_seal(entry.file, kind);
    const Hdf5Reader in(entry.file);
    if (in.shape(grid + "Points").rows != points ||
        in.array<std::int64_t>(grid + "Connectivity") != connectivity) {
      in.refuse("has other points or cells than the first frame of its series");
    }
    const std::size_t row = times.size() * points;
    out.rows<float>(grid + "Points", row, in.array<float>(grid + "Points", 3), 3);
    for (const Field& field : fields) copy_field(in, field, out, row);
    point_offsets.push_back(static_cast<std::int64_t>(row));
    times.push_back(entry.time);
  }
  // Parts, cells and connectivity stay where they are in every step: stored once.
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
  out.close();
  seal_in_place(temporary, "trajectory");
  move_into_place(temporary, out_file, Durable::yes);
  guard.finished();
}

}  // namespace phyxel
