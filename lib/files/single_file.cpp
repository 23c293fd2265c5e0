/// Export of a trajectory to one temporal VTKHDF file.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <numeric>
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

/// Adds an array that concatenates those of the frames, which differ in length.
/// @param ends number of values up to the end of each frame
template <class T>
void gather_varying(Hdf5Writer& out, const std::string& path,
                    const std::vector<SeriesEntry>& entries,
                    const std::vector<std::int64_t>& ends) {
  constexpr std::size_t chunk = 1 << 20;
  struct {
    std::size_t frame = std::numeric_limits<std::size_t>::max();
    std::vector<T> values;
  } read;  // the frame that was read last
  out.later<T>(path, static_cast<std::size_t>(ends.back()), 0, chunk,
               [=, &entries](std::size_t first, std::span<T> values) mutable {
                 for (T& value : values) {
                   const auto at = static_cast<std::int64_t>(first++);
                   const auto frame = static_cast<std::size_t>(
                       std::upper_bound(ends.begin(), ends.end(), at) - ends.begin());
                   if (frame != read.frame) {
                     read = {frame, Hdf5Reader(entries[frame].file).array<T>(path)};
                   }
                   const std::int64_t begin = frame > 0 ? ends[frame - 1] : 0;
                   const auto k = static_cast<std::size_t>(at - begin);
                   if (k >= read.values.size()) {
                     throw InputError(fmt::format("{}: changed while it was read",
                                                  entries[frame].file.string()));
                   }
                   value = read.values[k];
                 }
               });
}

void put(Hdf5Writer& out, const std::string& path, const std::vector<std::int64_t>& values,
         std::size_t columns) {
  out.array<std::int64_t>(path, values, columns);
}

/// The properties that the frames of a series share, and their times [s].
struct CommonFrame {
  std::string kind;
  std::size_t points = 0;
  std::vector<std::int64_t> connectivity, offsets;  ///< Those of the first frame.
  bool varies = false;  ///< True if the triangles of a surface change, as where it breaks.
  std::vector<std::int64_t> cells;  ///< Of each frame.
  std::vector<Field> fields;
  bool floats_do = true;  ///< True if float is precise enough for the positions of all frames.
  std::vector<double> times;
};

/// Reads the layout of the first frame and checks that the others have the same.
/// @throws InputError for frames that are damaged, of another kind or of other points, and for
/// phyxels of other cells
CommonFrame read_common(const std::vector<SeriesEntry>& entries) {
  CommonFrame common;
  common.kind = check_seal(entries.front().file);
  if (common.kind != phyxel_frame_kind && common.kind != surface_frame_kind) {
    throw InputError(fmt::format("{}: is a phyxel {}; expected a frame",
                                 entries.front().file.string(), common.kind));
  }
  const Hdf5Reader first(entries.front().file);
  common.points = first.shape(grid + "Points").rows;
  common.connectivity = first.array<std::int64_t>(grid + "Connectivity");
  common.offsets = first.array<std::int64_t>(grid + "Offsets");
  for (const std::string& name : first.names("/VTKHDF/PointData")) {
    common.fields.push_back(
        {name, first.is_integer(point_data + name), first.shape(point_data + name).columns});
  }
  for (const SeriesEntry& entry : entries) {
    check_seal(entry.file, common.kind);
    const Hdf5Reader in(entry.file);
    const bool same = in.array<std::int64_t>(grid + "Connectivity") == common.connectivity;
    if (in.shape(grid + "Points").rows != common.points ||
        (!same && common.kind != surface_frame_kind)) {
      in.refuse("has other points or cells than the first frame of its series");
    }
    common.varies = common.varies || !same;
    common.cells.push_back(static_cast<std::int64_t>(in.shape(grid + "Types").rows));
    common.floats_do = common.floats_do && !in.has_attribute("/phyxel", far_attribute);
    common.times.push_back(entry.time);
  }
  return common;
}

/// Partial sums, each with the term at its place. @param factor of each term. @param more than it
std::vector<std::int64_t> ends_of(const std::vector<std::int64_t>& terms, std::int64_t factor,
                                  std::int64_t more) {
  std::vector<std::int64_t> ends;
  std::int64_t sum = 0;
  for (const std::int64_t term : terms) ends.push_back(sum += factor * term + more);
  return ends;
}

/// Where the values of each frame begin that end there.
std::vector<std::int64_t> begins_of(std::vector<std::int64_t> ends) {
  ends.insert(ends.begin(), 0);
  ends.pop_back();
  return ends;
}

/// Writes the numbers of points and cells, and the cells: once if all frames have the same, else
/// those of each frame, as of a part of its own.
void put_cells(Hdf5Writer& out, const CommonFrame& common,
               const std::vector<SeriesEntry>& entries) {
  if (!common.varies) {
    const Hdf5Reader first(entries.front().file);
    put(out, grid + "NumberOfPoints", {static_cast<std::int64_t>(common.points)}, 0);
    put(out, grid + "NumberOfCells", {static_cast<std::int64_t>(common.offsets.size()) - 1}, 0);
    put(out, grid + "NumberOfConnectivityIds",
        {static_cast<std::int64_t>(common.connectivity.size())}, 0);
    out.array<std::uint8_t>(grid + "Types", first.array<std::uint8_t>(grid + "Types"));
    put(out, grid + "Connectivity", common.connectivity, 0);
    put(out, grid + "Offsets", common.offsets, 0);
    return;
  }
  std::vector<std::int64_t> corners = common.cells;
  for (std::int64_t& count : corners) count *= 3;
  put(out, grid + "NumberOfPoints",
      std::vector(entries.size(), static_cast<std::int64_t>(common.points)), 0);
  put(out, grid + "NumberOfCells", common.cells, 0);
  put(out, grid + "NumberOfConnectivityIds", corners, 0);
  gather_varying<std::uint8_t>(out, grid + "Types", entries, ends_of(common.cells, 1, 0));
  gather_varying<std::int64_t>(out, grid + "Connectivity", entries, ends_of(common.cells, 3, 0));
  gather_varying<std::int64_t>(out, grid + "Offsets", entries, ends_of(common.cells, 1, 1));
}

/// Writes the group of steps. Parts, cells and connectivity that are the same in each are stored
/// once.
void put_steps(Hdf5Writer& out, const CommonFrame& common) {
  const std::size_t steps = common.times.size();
  const std::vector<std::int64_t> zeros(steps, 0), ones(steps, 1);
  std::vector<std::int64_t> point_offsets, part_offsets = zeros;
  if (common.varies) std::iota(part_offsets.begin(), part_offsets.end(), 0);
  for (std::size_t k = 0; k < steps; ++k) {
    point_offsets.push_back(static_cast<std::int64_t>(k * common.points));
  }
  out.group("/VTKHDF/Steps");
  out.attribute("/VTKHDF/Steps", "NSteps", static_cast<std::int64_t>(steps));
  out.array<double>(grid + "Steps/Values", common.times);
  put(out, grid + "Steps/PartOffsets", part_offsets, 0);
  put(out, grid + "Steps/NumberOfParts", ones, 0);
  put(out, grid + "Steps/PointOffsets", point_offsets, 0);
  const auto cells_before = [&](std::int64_t factor) {
    return common.varies ? begins_of(ends_of(common.cells, factor, 0)) : zeros;
  };
  put(out, grid + "Steps/CellOffsets", cells_before(1), 1);
  put(out, grid + "Steps/ConnectivityIdOffsets", cells_before(3), 1);
  out.group("/VTKHDF/Steps/PointDataOffsets");
  for (const Field& field : common.fields) {
    put(out, grid + "Steps/PointDataOffsets/" + field.name, point_offsets, 0);
  }
}

}  // namespace

void export_single(const fs::path& series, const fs::path& out_file, bool overwrite) {
  const std::vector<SeriesEntry> entries = read_series(series);
  if (entries.empty()) throw InputError(fmt::format("{}: lists no frames", series.string()));
  check_output_file(out_file, overwrite, Output::file);
  make_writable_folder(out_file.has_parent_path() ? out_file.parent_path() : ".");

  const CommonFrame common = read_common(entries);
  const Hdf5Reader first(entries.front().file);

  // In memory except for the concatenated arrays, so that HDF5 never writes to a full disk.
  Hdf5Writer out;
  out.group("/VTKHDF");
  const std::int64_t version[] = {2, 0};
  out.attribute("/VTKHDF", "Version", std::span<const std::int64_t>(version));
  out.attribute("/VTKHDF", "Type", std::string("UnstructuredGrid"));
  put_cells(out, common, entries);
  const auto gather_reals = [&](const std::string& path, std::size_t columns, bool as_float) {
    (as_float ? gather<float> : gather<double>)(out, path, entries, common.points, columns);
  };
  gather_reals(grid + "Points", 3, common.floats_do);
  for (const Field& field : common.fields) {
    if (field.integer) {
      gather<Index>(out, point_data + field.name, entries, common.points, field.columns);
    } else {
      gather_reals(point_data + field.name, field.columns,
                   common.floats_do || field.name != "displacement");
    }
  }
  out.group("/phyxel");
  out.attribute("/phyxel", "version", std::int64_t{1});
  out.attribute("/phyxel", "program", program_version());
  out.attribute("/phyxel", "title", first.text_attribute("/phyxel", "title"));
  out.text("/phyxel/scene", first.text("/phyxel/scene"));

  put_steps(out, common);
  write_sealed(out_file, "trajectory", out.content(), Durable::yes);
}

}  // namespace phyxel
