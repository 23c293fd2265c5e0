#include "phyxel/body_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "files/atomic_file.hpp"
#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "model/cloud_check.hpp"
#include "phyxel/error.hpp"
#include "sort_unique.hpp"
#include "version.hpp"

namespace phyxel {
namespace {

constexpr const char* kind = "body";
constexpr std::int64_t version = 1;

/// Checks that points are finite and that an Index can count them. @throws InputError
void check_points(const Hdf5Reader& in, const std::string& path, const std::vector<Vec3d>& points) {
  if (points.size() > static_cast<std::size_t>(std::numeric_limits<Index>::max())) {
    in.refuse(fmt::format("{} has {} rows; allowed at most {}", path, points.size(),
                          std::numeric_limits<Index>::max()));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_finite(points[i])) in.refuse(fmt::format("{} is not finite in row {}", path, i));
  }
}

void check_range(const Hdf5Reader& in, const std::string& path, std::span<const Index> indices,
                 std::size_t count) {
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] < 0 || static_cast<std::size_t>(indices[i]) >= count) {
      in.refuse(fmt::format("{} holds the index {} at {}; allowed 0 to {}", path, indices[i], i,
                            static_cast<std::int64_t>(count) - 1));
    }
  }
}

Surface read_surface(const Hdf5Reader& in) {
  Surface surface;
  surface.position = in.vectors("/surface/position");
  surface.normal = in.vectors("/surface/normal");
  check_points(in, "/surface/position", surface.position);
  check_points(in, "/surface/normal", surface.normal);
  if (surface.normal.size() != surface.position.size()) {
    in.refuse(fmt::format("/surface/normal has {} rows, /surface/position {}",
                          surface.normal.size(), surface.position.size()));
  }
  const std::vector<Index> corners = in.array<Index>("/surface/triangle", 3);
  check_range(in, "/surface/triangle", corners, surface.position.size());
  surface.triangle.resize(corners.size() / 3);
  for (std::size_t t = 0; t < surface.triangle.size(); ++t) {
    surface.triangle[t] = {corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]};
  }
  if (in.has("/surface/groups")) {
    for (const std::string& name : in.names("/surface/groups")) {
      const std::string path = "/surface/groups/" + name;
      std::vector<Index> triangles = in.array<Index>(path);
      check_range(in, path, triangles, surface.triangle.size());
      sort_unique(triangles);
      surface.groups[name] = std::move(triangles);
    }
  }
  return surface;
}

/// Reads one positive value for each phyxel; none if the file lacks the array. @throws InputError
std::vector<double> read_positive(const Hdf5Reader& in, const char* path, const char* unit,
                                  std::size_t phyxels) {
  if (!in.has(path)) return {};
  std::vector<double> values = in.array<double>(path);
  if (values.size() != phyxels) {
    in.refuse(fmt::format("{} has {} rows, /position {}", path, values.size(), phyxels));
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] > 0 && std::isfinite(values[i])) continue;
    in.refuse(fmt::format("{} is {} in row {}; allowed > 0 {}", path, values[i], i, unit));
  }
  return values;
}

}  // namespace

void write_body(const std::filesystem::path& file, const Cloud& cloud, bool overwrite) {
  check_cloud(cloud, file.string() + ": ", "");
  check_output_file(file, overwrite, Output::file);
  make_writable_folder(file.has_parent_path() ? file.parent_path() : ".");
  Hdf5Writer out;
  out.group("/phyxel");
  out.attribute("/phyxel", "version", version);
  out.attribute("/phyxel", "program", program_version());
  out.attribute("/phyxel", "units", std::string("m, m^3"));
  if (cloud.lattice) out.attribute("/phyxel", "lattice", std::int64_t{1});
  out.vectors("/position", cloud.position, false);
  if (!cloud.volume.empty()) out.array<double>("/volume", cloud.volume);
  if (!cloud.spacing.empty()) out.array<double>("/spacing", cloud.spacing);
  const Surface& surface = cloud.surface;
  if (!surface.position.empty()) {
    out.vectors("/surface/position", surface.position, false);
    out.vectors("/surface/normal", surface.normal, false);
    const Index* corners = surface.triangle.empty() ? nullptr : surface.triangle.front().data();
    out.array<Index>("/surface/triangle", std::span(corners, 3 * surface.triangle.size()), 3);
    for (const auto& [name, triangles] : surface.groups) {
      out.array<Index>("/surface/groups/" + name, triangles);
    }
  }
  for (const auto& [name, phyxels] : cloud.regions) out.array<Index>("/regions/" + name, phyxels);
  write_sealed(file, kind, out.content(), Durable::yes);
}

bool has_spacing(const std::filesystem::path& file) {
  try {
    return Hdf5Reader(file).has("/spacing");
  } catch (const InputError&) {
    return false;  // `read_body` says why
  }
}

Cloud read_body(const std::filesystem::path& file) {
  check_seal(file, kind);
  const Hdf5Reader in(file);
  if (const std::int64_t found = in.integer_attribute("/phyxel", "version"); found != version) {
    in.refuse(fmt::format("format version {}; this program reads version {}", found, version));
  }
  Cloud cloud;
  cloud.position = in.vectors("/position");
  if (cloud.position.empty()) in.refuse("has no phyxels");
  check_points(in, "/position", cloud.position);
  cloud.volume = read_positive(in, "/volume", "m^3", cloud.position.size());
  cloud.spacing = read_positive(in, "/spacing", "m", cloud.position.size());
  if (in.has("/surface")) cloud.surface = read_surface(in);
  cloud.lattice =
      in.has_attribute("/phyxel", "lattice") && in.integer_attribute("/phyxel", "lattice") != 0;
  for (const std::string& name : in.names("/regions")) {
    const std::string path = "/regions/" + name;
    std::vector<Index> phyxels = in.array<Index>(path);
    check_range(in, path, phyxels, cloud.position.size());
    sort_unique(phyxels);
    cloud.regions[name] = std::move(phyxels);
  }
  return cloud;
}

}  // namespace phyxel
