#include "kind.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <string_view>
#include <vector>

#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// True for HDF5 files and sealed files, which have a seal before HDF5's signature.
bool is_hdf5(const fs::path& file) {
  constexpr std::string_view signature("\x89HDF\r\n\x1a\n", 8), seal("phyxel s");
  char bytes[8] = {};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes, sizeof bytes);
  const std::string_view head(bytes, sizeof bytes);
  return in && (head == signature || head == seal);
}

/// The kind in words, and the command that takes it.
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
      return "is a table";
    default:
      return "is of an unknown kind";
  }
}

struct Extension {
  std::string_view end;
  Kind kind;
};
/// The program's one list of file extensions.
constexpr Extension extensions[] = {{".toml", Kind::scene},    {".obj", Kind::mesh},
                                    {".ply", Kind::mesh},      {".stl", Kind::mesh},
                                    {".series", Kind::series}, {".csv", Kind::table}};

/// The extensions of a kind, e.g. " (.obj, .ply, .stl)".
std::string extensions_of(Kind kind) {
  std::vector<std::string_view> ends;
  for (const Extension& e : extensions) {
    if (e.kind == kind) ends.push_back(e.end);
  }
  return ends.empty() ? "" : fmt::format(" ({})", fmt::join(ends, ", "));
}

const char* noun_of(Kind kind) {
  switch (kind) {
    case Kind::folder:
      return "a run's folder";
    case Kind::scene:
      return "a scene";
    case Kind::mesh:
      return "a mesh";
    case Kind::series:
      return "a series";
    case Kind::hdf5:
      return "an HDF5 file of phyxel";
    case Kind::table:
      return "a table";
    default:
      return "a file";
  }
}

/// A list of kinds, e.g. "a run's folder, a series (.series), an HDF5 file of phyxel".
std::string in_words(std::initializer_list<Kind> wanted) {
  std::vector<std::string> words;
  for (const Kind kind : wanted) words.push_back(noun_of(kind) + extensions_of(kind));
  return fmt::format("{}", fmt::join(words, ", "));
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
  for (const Extension& known : extensions) {
    if (end == known.end) return known.kind;
  }
  if (fs::is_regular_file(status) && is_hdf5(file)) return Kind::hdf5;
  return Kind::unknown;
}

Kind expect_kind(const fs::path& file, std::initializer_list<Kind> wanted) {
  const Kind kind = kind_of(file);
  if (kind == Kind::missing || kind == Kind::unknown) return kind;
  if (std::find(wanted.begin(), wanted.end(), kind) != wanted.end()) return kind;
  throw InputError(
      fmt::format("{}: {}; allowed here: {}", file.string(), advice(file, kind), in_words(wanted)));
}

}  // namespace phyxel::app
