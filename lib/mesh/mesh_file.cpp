#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "files/atomic_file.hpp"
#include "mesh/mesh_formats.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

std::string read_bytes(const std::filesystem::path& file) {
  require_regular_file(file, "a mesh file");
  std::error_code error;
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  const auto size = std::filesystem::file_size(file, error);
  if (!stream || error) {
    throw InputError(fmt::format("{}: cannot be read: {}", file.string(), std::strerror(errno)));
  }
  if (size > largest_file) {
    throw InputError(
        fmt::format("{}: {} bytes; at most {} are allowed", file.string(), size, largest_file));
  }
  std::string content(size, '\0');
  stream.read(content.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(stream.gcount()) != size) {
    throw InputError(
        fmt::format("{}: only {} of {} bytes could be read", file.string(), stream.gcount(), size));
  }
  return content;
}

MeshFormat format_of(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  if (extension == ".obj") return MeshFormat::obj;
  if (extension == ".ply") return MeshFormat::ply;
  if (extension == ".stl") return MeshFormat::stl;
  throw InputError(fmt::format("{}: the extension \"{}\" is not one of .obj, .ply, .stl",
                               file.string(), extension));
}

}  // namespace

Surface parse_mesh(std::string_view content, MeshFormat format, const std::string& name) {
  if (content.empty()) throw InputError(fmt::format("{}: the file is empty", name));
  Surface surface;
  switch (format) {
    case MeshFormat::obj:
      surface = parse_obj(content, name);
      break;
    case MeshFormat::ply:
      surface = parse_ply(content, name);
      break;
    case MeshFormat::stl:
      surface = parse_stl(content, name);
      break;
  }
  if (surface.triangle.empty()) {
    throw InputError(fmt::format("{}: no faces ({} vertices)", name, surface.position.size()));
  }
  surface.normal = vertex_normals(surface.position, surface.triangle);
  return surface;
}

Surface read_mesh(const std::filesystem::path& file) {
  const MeshFormat format = format_of(file);
  return in_stage("reading the mesh",
                  [&] { return parse_mesh(read_bytes(file), format, file.string()); });
}

}  // namespace phyxel
