#include "kind.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <string_view>

#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// True for HDF5 files, and for ours, which have a seal before HDF5's own signature.
bool is_hdf5(const fs::path& file) {
  constexpr std::string_view signature("\x89HDF\r\n\x1a\n", 8), seal("phyxel s");
  char bytes[8] = {};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes, sizeof bytes);
  const std::string_view head(bytes, sizeof bytes);
  return in && (head == signature || head == seal);
}

/// The kind in words, and the command for it.
std::string advice(const fs::path& file, Kind kind) {
  const std::string name = file.string();
  switch (kind) {
    case Kind::folder:
      return fmt::format(
          "is a folder; \"phyxel info {0}\" says what it holds, \"phyxel render {0}\" draws a run",
          name);
    case Kind::scene:
      return fmt::format("is a scene; \"phyxel run {}\" simulates it", name);
    case Kind::mesh:
      return fmt::format(
          "is a mesh; \"phyxel sample {0} --phyxels 5000 --out body.h5\" fills it, and a scene "
          "simulates it: [[body]] with mesh = \"{0}\", phyxels and [body.material]",
          name);
    case Kind::series:
      return fmt::format("is a series of frames; \"phyxel render {}\" draws it", name);
    case Kind::hdf5:
      return fmt::format(
          "is an HDF5 file (a body, frame or checkpoint); \"phyxel info {0}\" says which. A scene "
          "simulates a body: [[body]] with file = \"{0}\"; a checkpoint goes on by \"phyxel run "
          "SCENE --resume {0}\"",
          name);
    case Kind::table:
      return fmt::format("is a table; \"phyxel report {}\" shows it", name);
    default:
      return "is of an unknown kind";
  }
}

const char* wanted_in_words(Kind wanted) {
  if (wanted == Kind::scene) return "a scene (.toml)";
  if (wanted == Kind::mesh) return "a mesh (.obj, .ply, .stl)";
  return "a run's folder, a series (.hdf.series) or a frame";
}

}  // namespace

Kind kind_of(const fs::path& file) {
  std::error_code failed;
  const fs::file_status status = fs::status(file, failed);
  if (!fs::exists(status)) return Kind::missing;
  if (fs::is_directory(status)) return Kind::folder;
  std::string end = file.extension().string();
  std::transform(end.begin(), end.end(), end.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (end == ".toml") return Kind::scene;
  if (end == ".obj" || end == ".ply" || end == ".stl") return Kind::mesh;
  if (end == ".series") return Kind::series;
  if (end == ".csv") return Kind::table;
  if (fs::is_regular_file(status) && is_hdf5(file)) return Kind::hdf5;
  return Kind::unknown;
}

void expect_kind(const fs::path& file, Kind wanted) {
  const Kind kind = kind_of(file);
  if (kind == wanted || kind == Kind::missing || kind == Kind::unknown) return;
  throw InputError(fmt::format("{}: {}; allowed here: {}", file.string(), advice(file, kind),
                               wanted_in_words(wanted)));
}

}  // namespace phyxel::app
