#include "export/vtu.hpp"

#include <fmt/format.h>

#include <cstring>
#include <numeric>

#include "base64.hpp"
#include "files/atomic_file.hpp"
#include "report/page.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

constexpr std::uint8_t vtk_vertex = 1, vtk_triangle = 5;

template <class T>
constexpr const char* type_name() {
  if constexpr (std::is_same_v<T, double>) return "Float64";
  if constexpr (std::is_same_v<T, std::int32_t>) return "Int32";
  if constexpr (std::is_same_v<T, std::int64_t>) return "Int64";
  if constexpr (std::is_same_v<T, std::uint8_t>) return "UInt8";
}

/// An array as an element. @param columns number of components of a row
template <class T>
std::string data_array(const std::string& name, std::span<const T> values, std::size_t columns) {
  // The number of bytes stands before the array, in the same Base64 text.
  const std::uint64_t size = values.size_bytes();
  std::vector<std::byte> bytes(sizeof size + values.size_bytes());
  std::memcpy(bytes.data(), &size, sizeof size);
  if (!values.empty()) std::memcpy(bytes.data() + sizeof size, values.data(), values.size_bytes());
  // One component is the default of the format; where it is stated, some readers add a dimension.
  const std::string width = columns == 1 ? "" : fmt::format(" NumberOfComponents=\"{}\"", columns);
  return fmt::format("<DataArray type=\"{}\" Name=\"{}\"{} format=\"binary\">\n{}\n</DataArray>\n",
                     type_name<T>(), html_text(name), width, base64(bytes));
}

std::string vectors(const std::string& name, const std::vector<Vec3d>& values) {
  std::vector<double> numbers;
  for (const Vec3d v : values) numbers.insert(numbers.end(), {v.x, v.y, v.z});
  return data_array<double>(name, numbers, 3);
}

std::string cells_of(const FrameData& frame) {
  std::vector<std::int64_t> corners, ends;
  for (const Triangle& triangle : frame.triangle) {
    corners.insert(corners.end(), triangle.begin(), triangle.end());
    ends.push_back(static_cast<std::int64_t>(corners.size()));
  }
  const bool phyxels = frame.triangle.empty();
  if (phyxels) {
    corners.resize(frame.point.size());
    std::iota(corners.begin(), corners.end(), 0);
    ends = corners;
    for (std::int64_t& end : ends) ++end;
  }
  const std::vector<std::uint8_t> types(ends.size(), phyxels ? vtk_vertex : vtk_triangle);
  return "<Cells>\n" + data_array<std::int64_t>("connectivity", corners, 1) +
         data_array<std::int64_t>("offsets", ends, 1) +
         data_array<std::uint8_t>("types", types, 1) + "</Cells>\n";
}

std::string fields_of(const FrameData& frame) {
  std::string text = "<PointData>\n";
  if (!frame.normal.empty()) text += vectors("Normals", frame.normal);
  if (!frame.body.empty()) text += data_array<Index>("body", frame.body, 1);
  for (const auto& [name, values] : frame.field) {
    const std::size_t columns = frame.point.empty() ? 1 : values.size() / frame.point.size();
    text += data_array<double>(name, values, columns);
  }
  return text + "</PointData>\n";
}

/// A collection of files with their times [s].
std::string collection(const std::vector<SeriesEntry>& entries) {
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n";
  for (const SeriesEntry& entry : entries) {
    text += fmt::format("<DataSet timestep=\"{}\" file=\"{}\"/>\n", entry.time,
                        html_text(entry.file.string()));
  }
  return text + "</Collection>\n</VTKFile>\n";
}

}  // namespace

std::string vtu_text(const FrameData& frame) {
  const std::size_t cells = frame.triangle.empty() ? frame.point.size() : frame.triangle.size();
  return fmt::format(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<UnstructuredGrid>\n<FieldData>\n"
      "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">\n{}\n"
      "</DataArray>\n</FieldData>\n"
      "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>\n{}</Points>\n{}{}</Piece>\n"
      "</UnstructuredGrid>\n</VTKFile>\n",
      frame.time, frame.point.size(), cells, vectors("Points", frame.point), cells_of(frame),
      fields_of(frame));
}

std::vector<fs::path> export_vtu(const fs::path& input, const fs::path& folder,
                                 const FrameChoice& choice, bool overwrite) {
  const std::vector<Shot> shots = find_trajectory(input, {}).shots;
  struct Family {
    const char* name;
    fs::path Shot::*file;
    std::vector<SeriesEntry> entries = {};  // of the exported files
  } families[] = {{"surface", &Shot::surface}, {"phyxels", &Shot::phyxels}};
  const std::vector<std::size_t> chosen = choose_frames(choice, shots.size());
  for (Family& family : families) {
    for (const std::size_t k : chosen) {
      if ((shots[k].*family.file).empty()) continue;
      family.entries.push_back({fmt::format("{}_{:06d}.vtu", family.name, k), shots[k].time});
      check_output_file(folder / family.entries.back().file, overwrite, Output::file);
    }
    if (!family.entries.empty()) {
      check_output_file(folder / (std::string(family.name) + ".pvd"), overwrite, Output::file);
    }
  }
  make_writable_folder(folder);
  std::vector<fs::path> written;
  for (const Family& family : families) {
    auto entry = family.entries.begin();
    for (const std::size_t k : chosen) {
      const fs::path& file = shots[k].*family.file;
      if (file.empty()) continue;
      written.push_back(folder / (entry++)->file);
      write_whole_file(written.back(), vtu_text(read_frame(file, true)), Durable::no);
    }
  }
  for (const Family& family : families) {
    if (family.entries.empty()) continue;
    written.push_back(folder / (std::string(family.name) + ".pvd"));
    write_whole_file(written.back(), collection(family.entries), Durable::yes);
  }
  return written;
}

}  // namespace phyxel::app
