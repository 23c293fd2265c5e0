#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "files/atomic_file.hpp"
#include "mesh/mesh_formats.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "sort_unique.hpp"
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

void FaceGroups::add(std::string_view name, Index face) {
  if (name.empty()) return;
  auto at = faces_.find(name);
  if (at == faces_.end()) {
    if (faces_.size() > most_groups) return;
    at = faces_.try_emplace(std::string(name)).first;
  }
  if (at->second.empty() || at->second.back() != face) at->second.push_back(face);
}

std::map<std::string, std::vector<Index>> FaceGroups::of_triangles(
    std::span<const std::size_t> first_triangle) const {
  std::map<std::string, std::vector<Index>> groups;
  if (faces_.size() > most_groups) return groups;
  for (const auto& [name, faces] : faces_) {
    std::string safe = name;
    std::replace(safe.begin(), safe.end(), '/', '_');
    if (safe.find_first_not_of('.') == std::string::npos) safe.insert(0, "_");
    std::vector<Index>& triangles = groups[safe];
    for (const Index face : faces) {
      for (std::size_t t = first_triangle[face]; t < first_triangle[face + 1]; ++t) {
        triangles.push_back(static_cast<Index>(t));
      }
    }
    sort_unique(triangles);  // names that differ in a "/" only are one
    if (triangles.empty()) groups.erase(safe);
  }
  return groups;
}

void append_polygons(std::span<const Index> corner, std::span<const std::size_t> face_start,
                     const FaceGroups& groups, Surface& surface) {
  std::vector<std::size_t> first_triangle{0};
  for (std::size_t f = 0; f + 1 < face_start.size(); ++f) {
    append_polygon(corner.subspan(face_start[f], face_start[f + 1] - face_start[f]),
                   surface.position, surface.triangle);
    first_triangle.push_back(surface.triangle.size());
  }
  surface.groups = groups.of_triangles(first_triangle);
}

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
