#include "model/cloud_check.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>
#include <vector>

#include "phyxel/error.hpp"

namespace phyxel {
namespace {

bool is_in_reach(Vec3d p) {
  const auto within = [](double x) { return std::abs(x) <= longest_length; };
  return within(p.x) && within(p.y) && within(p.z);
}

std::string in_words(Vec3d v) { return fmt::format("[{:g}, {:g}, {:g}]", v.x, v.y, v.z); }

/// Throws an InputError about a cloud.
class CloudFault {
 public:
  CloudFault(std::string where, std::string whose)
      : where_(std::move(where)), whose_(std::move(whose)) {}
  /// "<where>phyxel 5<whose> <problem>"
  [[noreturn]] void refuse(const char* what, std::size_t number, const std::string& problem) const {
    throw InputError(fmt::format("{}{} {}{} {}", where_, what, number, whose_, problem));
  }
  /// "<where>the cloud<whose> <problem>"
  [[noreturn]] void refuse(const std::string& problem) const {
    throw InputError(fmt::format("{}the cloud{} {}", where_, whose_, problem));
  }

 private:
  std::string where_, whose_;
};

void check_place(const CloudFault& fault, const char* what, std::size_t number, Vec3d place) {
  if (is_in_reach(place)) return;
  fault.refuse(what, number,
               fmt::format("lies at {} m; allowed: coordinates from {:g} to {:g} m",
                           in_words(place), -longest_length, longest_length));
}

void check_volume_count(const CloudFault& fault, const Cloud& cloud) {
  if (cloud.volume.empty() || cloud.volume.size() == cloud.position.size()) return;
  fault.refuse(fmt::format("has {} volumes for {} phyxels; allowed: as many, or none",
                           cloud.volume.size(), cloud.position.size()));
}

void check_spacing_count(const CloudFault& fault, const Cloud& cloud) {
  if (cloud.spacing.empty() || cloud.spacing.size() == cloud.position.size()) return;
  fault.refuse(fmt::format("has {} spacings for {} phyxels; allowed: as many, or none",
                           cloud.spacing.size(), cloud.position.size()));
}

void check_phyxels(const CloudFault& fault, const Cloud& cloud) {
  if (cloud.position.empty()) fault.refuse("has no phyxel; allowed: at least one");
  check_volume_count(fault, cloud);
  check_spacing_count(fault, cloud);
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    check_place(fault, "phyxel", i, cloud.position[i]);
    if (!cloud.volume.empty() && !(cloud.volume[i] > 0 && std::isfinite(cloud.volume[i]))) {
      fault.refuse("phyxel", i,
                   fmt::format("has a volume of {:g} m^3 (is the body flat?); allowed: > 0, finite",
                               cloud.volume[i]));
    }
    if (!cloud.spacing.empty() && !(cloud.spacing[i] > 0 && cloud.spacing[i] <= longest_length)) {
      fault.refuse("phyxel", i,
                   fmt::format("has a spacing of {:g} m; allowed: > 0, at most {:g} m",
                               cloud.spacing[i], longest_length));
    }
  }
}

void check_surfels(const CloudFault& fault, const Surface& surface) {
  if (surface.normal.size() != surface.position.size()) {
    fault.refuse(fmt::format("has {} normals for {} surfels; allowed: one for each",
                             surface.normal.size(), surface.position.size()));
  }
  for (std::size_t s = 0; s < surface.position.size(); ++s) {
    check_place(fault, "surfel", s, surface.position[s]);
    if (!is_finite(surface.normal[s])) {
      fault.refuse(
          "surfel", s,
          fmt::format("has the normal {}; allowed: finite numbers", in_words(surface.normal[s])));
    }
  }
}

/// @param vertex the word for a corner's vertex
void check_corners(const CloudFault& fault, std::span<const Triangle> triangles,
                   std::size_t vertices, const char* vertex) {
  const auto n = static_cast<Offset>(vertices);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const Index corner : triangles[t]) {
      if (corner >= 0 && corner < n) continue;
      fault.refuse(
          "triangle", t,
          fmt::format("names {} {}; allowed: {}", vertex, corner,
                      n == 0 ? "no triangle, as there are none" : fmt::format("0 to {}", n - 1)));
    }
  }
}

/// @param ascending whether the phyxels of a region must be, too
void check_regions(const CloudFault& fault, const Cloud& cloud, bool ascending) {
  const auto n = static_cast<Offset>(cloud.position.size());
  for (const auto& [name, members] : cloud.regions) {
    Offset last = -1;
    for (const Index i : members) {
      if (i < 0 || i >= n) {
        fault.refuse(
            fmt::format("has phyxel {} in region \"{}\"; allowed: 0 to {}", i, name, n - 1));
      }
      if (ascending && i <= last) {
        fault.refuse(fmt::format(
            "has phyxel {} after phyxel {} in region \"{}\"; allowed: ascending, each once", i,
            last, name));
      }
      last = i;
    }
  }
}

void check_groups(const CloudFault& fault, const Surface& surface) {
  const auto n = static_cast<Offset>(surface.triangle.size());
  for (const auto& [name, triangles] : surface.groups) {
    for (const Index t : triangles) {
      if (t >= 0 && t < n) continue;
      fault.refuse(
          fmt::format("has triangle {} in group \"{}\"; allowed: 0 to {}", t, name, n - 1));
    }
  }
}

}  // namespace

void check_triangles(std::span<const Triangle> triangles, std::size_t vertices) {
  check_corners({"", " of the surface"}, triangles, vertices, "vertex");
}

void check_surface(const Surface& surface) {
  const CloudFault fault("", " of the surface");
  for (std::size_t v = 0; v < surface.position.size(); ++v) {
    if (is_finite(surface.position[v])) continue;
    fault.refuse("vertex", v,
                 fmt::format("is at {}; allowed: finite numbers", in_words(surface.position[v])));
  }
  check_triangles(surface.triangle, surface.position.size());
}

void check_order(const Cloud& cloud, std::span<const Index> order) {
  const CloudFault fault("", "");
  const std::size_t n = cloud.position.size();
  if (order.size() != n) {
    fault.refuse(
        fmt::format("has {} phyxels for an order of {}; allowed: as many", n, order.size()));
  }
  std::vector<bool> seen(n, false);
  for (std::size_t k = 0; k < n; ++k) {
    const bool known = order[k] >= 0 && static_cast<std::size_t>(order[k]) < n;
    if (!known || seen[order[k]]) {
      fault.refuse(fmt::format("has phyxel {} at place {} of an order; allowed: 0 to {}, each once",
                               order[k], k, n - 1));
    }
    seen[order[k]] = true;
  }
  check_volume_count(fault, cloud);
  check_spacing_count(fault, cloud);
  check_regions(fault, cloud, false);
}

void check_cloud(const Cloud& cloud, const std::string& where, const std::string& whose) {
  const CloudFault fault(where, whose);
  check_phyxels(fault, cloud);
  check_surfels(fault, cloud.surface);
  check_groups(fault, cloud.surface);
  check_corners(fault, cloud.surface.triangle, cloud.surface.position.size(), "surfel");
  check_regions(fault, cloud, true);
}

void check_cloud(const BodyRequest& request, const Cloud& cloud) {
  check_cloud(cloud, request.where + ": ", fmt::format(" of body \"{}\"", request.name));
}

}  // namespace phyxel
