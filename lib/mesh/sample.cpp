#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mesh/filling_device.hpp"
#include "mesh/graded_filling.hpp"
#include "mesh/grading.hpp"
#include "mesh/inside_filling.hpp"
#include "mesh/lattice_filling.hpp"
#include "mesh/repulsion.hpp"
#include "mesh/scattered_filling.hpp"
#include "mesh/surface_sites.hpp"
#include "mesh/surface_topology.hpp"
#include "mesh/triangle.hpp"
#include "model/closing_areas.hpp"
#include "model/cloud_check.hpp"
#include "model/graded_hash.hpp"
#include "model/spatial_hash.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "sort_unique.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Memory that a phyxel takes while a lattice fills a body [bytes]: 340 of 500,000 in a cube, 150
/// of ten million. Memory for phyxels on the surface is checked when their number is known.
constexpr double bytes_on_lattice = 350;

/// Refuses a number of phyxels that takes more memory than there is.
/// @param bytes memory for each phyxel
void check_memory(Index phyxels, double bytes) {
  const double memory =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
  if (phyxels * bytes > memory) {
    throw InputError(fmt::format(
        "{} phyxels need about {:.0f} GiB of memory to sample, but this machine has {:.0f} GiB; "
        "allowed here: at most about {:.2g}",
        phyxels, phyxels * bytes / 0x1p30, memory / 0x1p30, memory / bytes));
  }
}

/// Refuses a surface whose size would overflow or underflow when cubed, or whose coordinates are
/// too coarse for its shape. @returns the surface's extent [m].
double check_extent(const Surface& surface) {
  constexpr double smallest = 1e-30, largest = 1e31;  // [m]
  Vec3d low = surface.position[surface.triangle[0][0]], high = low;
  for (const Triangle& t : surface.triangle) {
    for (const Index corner : t) {
      const Vec3d p = surface.position[corner];
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
  }
  const double extent = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
  if (!(extent >= smallest && extent <= largest)) {
    throw InputError(fmt::format("the surface is {:g} m across; allowed: {:g} to {:g} m", extent,
                                 smallest, largest));
  }
  const double distance = norm(0.5 * low + 0.5 * high);
  if (extent < 1e-9 * distance) {
    throw InputError(fmt::format(
        "the surface is {:g} m across, but {:g} m from the origin: its coordinates hold too few "
        "digits of its shape; move it nearer",
        extent, distance));
  }
  return extent;
}

void check_grading(const SampleRequest& request) {
  const Grading& grading = *request.grading;
  const auto check = [](const char* name, double value, double least, double most) {
    if (value >= least && value <= most) return;
    throw InputError(
        fmt::format("grading: {} is {:g}; allowed: {:g} to {:g}", name, value, least, most));
  };
  check("ratio", grading.ratio, 1, 10);
  check("growth", grading.growth, 0.05, 0.5);
  if (grading.per_radius) check("per_radius", *grading.per_radius, 0, 1000);
  if (grading.across) check("across", *grading.across, 0, 1000);
  for (const Grading::Finer& finer : grading.finer) check("by", finer.by, 1, grading.ratio);
  if (request.on_surface == false) {
    throw InputError(
        "a graded body has phyxels on its surface; allowed: on_surface = true, or no grading");
  }
}

void check_request(const Surface& surface, const SampleRequest& request) {
  if (request.phyxels < 1) {
    throw InputError(fmt::format("{} phyxels asked for; at least 1 is needed", request.phyxels));
  }
  if (request.relaxations < 0) {
    throw InputError(
        fmt::format("{} relaxations asked for; 0 or more are allowed", request.relaxations));
  }
  if (request.grading) check_grading(request);
  check_memory(request.phyxels, bytes_on_lattice);
  if (surface.triangle.empty()) throw InputError("the surface has no triangles");
  check_surface(surface);
}

/// Multiplies positions by 2^exponent, without rounding.
void scale(std::vector<Vec3d>& position, int exponent) {
  const double factor = std::ldexp(1.0, exponent);
  const auto n = static_cast<std::ptrdiff_t>(position.size());
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t i = 0; i < n; ++i) position[i] = factor * position[i];
}

void drop_unused_vertices(Surface& surface) {
  std::vector<Index> number(surface.position.size(), -1);
  for (const Triangle& t : surface.triangle) {
    for (const Index corner : t) number[corner] = 0;
  }
  Index kept = 0;
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] < 0) continue;
    surface.position[kept] = surface.position[v];
    number[v] = kept++;
  }
  surface.position.resize(kept);
  for (Triangle& t : surface.triangle) {
    for (Index& corner : t) corner = number[corner];
  }
}

void refuse_if_too_open(const SampleTally& tally, const SurfaceDefects& defects, bool closed) {
  if (closed || tally.samples == 0) return;
  const double doubtful = static_cast<double>(tally.doubtful) / static_cast<double>(tally.samples);
  if (doubtful <= 0.4) return;
  throw InputError(fmt::format(
      "the surface is too open to tell inside from outside: {:.0f}% of the interior points have an "
      "ambiguous winding number ({})",
      100 * doubtful, defects.describe()));
}

/// The distance from each phyxel to the nearest other one [m].
std::vector<double> gaps_between(const std::vector<Vec3d>& site, const SpacingField& spacing) {
  const auto measured = [&](const auto& hash) {
    return tabulated(site.size(), [&](std::size_t i) {
      return std::sqrt(hash.nearest(site[i], HUGE_VAL, static_cast<Index>(i)).distance2);
    });
  };
  return spacing.is_uniform() ? measured(SpatialHash(site, spacing.coarsest()))
                              : measured(GradedHash(site, spacing.at(site)));
}

/// Sets the mean and the smallest distance to the nearest phyxel [m]; zero for a single phyxel.
/// @param gap that distance, of each phyxel
void report_gaps(const std::vector<double>& gap, SampleReport& report) {
  if (gap.size() < 2) return;
  report.spacing = std::accumulate(gap.begin(), gap.end(), 0.0) / static_cast<double>(gap.size());
  report.smallest_gap = *std::min_element(gap.begin(), gap.end());
}

/// Refuses phyxels on a surface that is open or overlaps itself. A few samples inside an overlap
/// or beside a fold are tolerated.
void refuse_surface_phyxels(const SampleTally& tally, bool closed, const std::string& defects) {
  constexpr double allowed = 1e-3;
  const double repeated = static_cast<double>(tally.repeated) / static_cast<double>(tally.samples);
  if (closed && repeated <= allowed) return;
  throw InputError(fmt::format(
      "the surface {}, so it is not known where phyxels would lie on the body's outside; allowed: "
      "a closed surface without overlaps, or all phyxels inside",
      closed ? "overlaps itself" : fmt::format("is not closed ({})", defects)));
}

/// A surface ready for sampling.
struct PreparedSurface {
  Surface surface;           ///< Scaled to a size of one to two, with its triangles turned outward.
  int exponent;              ///< The scale is 2^exponent.
  SurfaceTopology topology;  ///< Connectivity of the scaled surface.
  std::string defects;       ///< Description of the original surface's defects.
};

/// Inspects, scales, cleans and orients a surface, and reports its defects and each change.
PreparedSurface prepare(const Surface& surface, SampleReport& found) {
  Stage inspecting("inspecting the surface");
  found.defects = inspect_surface(surface);
  // The surface is scaled to a size of one to two, the range in which float offsets are accurate.
  PreparedSurface made{.surface = surface,
                       .exponent = -std::ilogb(check_extent(surface)),
                       .topology = {},
                       .defects = found.defects.describe()};
  scale(made.surface.position, made.exponent);
  if (found.defects.unused_vertices > 0) {
    drop_unused_vertices(made.surface);
    found.warnings.push_back(fmt::format("{} vertices that no triangle uses were left out",
                                         found.defects.unused_vertices));
  }
  for (std::string& done : orient(made.surface)) found.warnings.push_back(std::move(done));
  made.surface.normal = vertex_normals(made.surface.position, made.surface.triangle);
  made.topology = connect(made.surface);
  inspecting.finish();
  return made;
}

/// The wanted distances between phyxels. @param filling of the inside
SpacingField wanted_spacing(const PreparedSurface& prepared, const InsideSampler& sampler,
                            const InsideFilling& filling, double volume,
                            const SampleRequest& request) {
  if (!request.grading) {
    return SpacingField(spacing_for(volume, sampler.area(), request.phyxels));
  }
  Grading scaled = *request.grading;
  for (Grading::Finer& finer : scaled.finer) {
    finer.region = finer.region.scaled(std::ldexp(1.0, prepared.exponent));
  }
  return graded_spacing({.surface = prepared.surface,
                         .topology = prepared.topology,
                         .inside = filling.blocks,
                         .voxel = filling.voxel,
                         .phyxels = request.phyxels},
                        scaled);
}

/// Phyxels on the surface; none if the request or the surface does not allow them.
SurfaceSites place_on_surface(const PreparedSurface& prepared, const InsideSampler& sampler,
                              const InsideFilling& filling, double volume,
                              const SampleRequest& request, SampleReport& found,
                              const SurfaceOnDevice* device) {
  Stage stage("phyxels on the surface");
  SurfaceSites sites;
  try {
    refuse_surface_phyxels(filling.tally, prepared.topology.closed, prepared.defects);
    std::vector<SpaceRegion> cuts;
    for (const SpaceRegion& cut : request.cuts) {
      cuts.push_back(cut.scaled(std::ldexp(1.0, prepared.exponent)));
    }
    sites = sites_on(prepared.surface, prepared.topology, volume,
                     wanted_spacing(prepared, sampler, filling, volume, request), sampler, cuts,
                     request.phyxels, request.seed + 3, request.relaxations, stage, device);
  } catch (const InputError& error) {
    if (request.on_surface) throw;
    if (request.grading) {
      throw InputError(fmt::format("a graded body has phyxels on its surface: {}", error.what()));
    }
    found.warnings.push_back(fmt::format("all phyxels lie inside: {}", error.what()));
  }
  stage.finish();
  return sites;
}

/// Fills the inside with about `samples` sample points.
InsideFilling filled(const PreparedSurface& prepared, const InsideSampler& sampler,
                     const SampleRequest& request, double samples) {
  const bool closed = prepared.topology.closed;
  InsideFilling filling;
  fill_inside(sampler,
              {.phyxels = request.phyxels,
               .samples = samples,
               .seed = request.seed,
               .triangles = prepared.surface.triangle.size(),
               .volume = closed ? std::optional(enclosed_volume(prepared.surface)) : std::nullopt,
               .exponent = prepared.exponent,
               .defects = prepared.defects},
              filling);
  return filling;
}

void report_tally(const PreparedSurface& prepared, const SampleTally& tally, SampleReport& found) {
  const auto percent = [&](Offset part) {
    return 100 * static_cast<double>(part) / static_cast<double>(tally.samples);
  };
  found.doubtful_fraction = percent(tally.doubtful) / 100;
  if (!prepared.topology.closed) {
    found.warnings.push_back(fmt::format(
        "the surface is not closed ({}); {:.2g}% of the interior points have an ambiguous winding "
        "number",
        prepared.defects, percent(tally.doubtful)));
  }
  if (tally.repeated > 0) {
    found.warnings.push_back(fmt::format(
        "the surface overlaps itself: {:.2g}% of the inside has a winding number above 1, and "
        "counts once",
        percent(tally.repeated)));
  }
}

/// Fills the inside of a surface that has phyxels on it.
/// @param gap receives `LatticeFilling::gap`
/// @returns the distances between phyxels
SpacingField fill_between(const PreparedSurface& prepared, const InsideSampler& sampler,
                          const SampleRequest& request, const SurfaceSites& sites, double volume,
                          bool exact_volume, const SurfaceOnDevice* device, Cloud& cloud,
                          std::vector<double>& gap) {
  const auto placed = static_cast<Index>(sites.position.size() + sites.on_cuts.size());
  const LatticeRequest lattice{.surface = prepared.surface,
                               .sampler = sampler,
                               .sites = sites,
                               .volume = volume,
                               .exact_volume = exact_volume,
                               .phyxels = request.phyxels - placed,
                               .seed = request.seed,
                               .sweeps = repulsion_sweeps(request.relaxations),
                               .device = device};
  SpacingField spacing = sites.spacing;
  LatticeFilling inside =
      spacing.is_uniform() ? fill_by_lattice(lattice) : fill_graded(lattice, spacing);
  cloud.position = all_sites(sites);
  const std::size_t before = cloud.position.size();
  cloud.position.resize(before + inside.position.size());
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < inside.position.size(); ++k) {
    cloud.position[before + k] = inside.position[k];
  }
  cloud.volume = std::move(inside.volume);
  gap = std::move(inside.gap);
  cloud.cuts = sites.cuts;
  if (spacing.is_uniform()) return SpacingField(inside.spacing);
  cloud.spacing = spacing.at(cloud.position);
  return spacing;
}

/// Warns of a grading, or of finer regions, without effect.
void warn_of_no_effect(const Cloud& cloud, const Grading& grading, int exponent,
                       SampleReport& found) {
  const auto [finest, coarsest] = std::ranges::minmax(cloud.spacing);
  if (grading.ratio > 1.1 && coarsest < 1.1 * finest) {
    found.warnings.push_back(
        "the grading has no effect: either nothing asks for phyxels nearer to each other than "
        "elsewhere, or the whole body asks for the nearest; other values of per_radius and across, "
        "or more phyxels, may grade it");
  }
  for (std::size_t k = 0; k < grading.finer.size(); ++k) {
    const SpaceRegion region = grading.finer[k].region.scaled(std::ldexp(1.0, exponent));
    const auto inside = [&](Vec3d p) { return region.contains(p); };
    if (std::ranges::any_of(cloud.position, inside)) continue;
    found.warnings.push_back(
        fmt::format("finer region {} of the grading holds no phyxel of the body", k + 1));
  }
}

/// The phyxels on the triangles of each named group, or, if all phyxels lie inside, those within a
/// spacing of them: regions of the cloud.
/// @param on_surface number of phyxels on the surface, which come first
void add_regions(Cloud& cloud, const Surface& surface, std::size_t on_surface, double spacing) {
  if (surface.groups.empty()) return;
  const std::size_t count = on_surface > 0 ? on_surface : cloud.position.size();
  const double within = (on_surface > 0 ? 1e-3 : 1.0) * spacing;
  const SpatialHash hash(std::span(cloud.position).first(count), spacing);
  for (const auto& [name, triangles] : surface.groups) {
    std::vector<Index> region;
    for (const Index t : triangles) {
      const auto [a, b, c] = surface.triangle[t];
      const Triangle alone{0, 1, 2};
      const Vec3d corner[] = {surface.position[a], surface.position[b], surface.position[c]};
      for (const Facet& piece : facets_of(corner, {&alone, 1}, 0, spacing)) {
        hash.visit_ball(piece.centroid, spacing + within, [&](const SpatialHash::Entry& e) {
          const Vec3d nearest = nearest_on_triangle(e.position, corner[0], corner[1], corner[2]);
          if (norm(e.position - nearest) <= within) region.push_back(e.index);
        });
      }
    }
    sort_unique(region);
    cloud.regions[name] = std::move(region);
  }
}

}  // namespace

Cloud sample_surface(const Surface& surface, const SampleRequest& request, SampleReport* report) {
  check_request(surface, request);
  SampleReport found;
  PreparedSurface prepared = prepare(surface, found);
  const bool closed = prepared.topology.closed;
  const InsideSampler sampler(prepared.surface, closed);
  std::unique_ptr<SurfaceOnDevice> device;
  if (const FillingDevice* const chosen = FillingScope::device();
      chosen && closed && suits_device(request)) {
    device = chosen->take(sampler.winding_number(), request.phyxels);
  }

  SurfaceSites sites;
  SampleTally tally;
  double volume = 0;
  bool exact = false;
  const auto measure = [&](const InsideFilling& filling) {
    tally = filling.tally;
    refuse_if_too_open(tally, found.defects, closed);
    // The divergence theorem counts regions with a winding number of two twice.
    exact = closed && tally.repeated == 0;
    volume = exact ? enclosed_volume(prepared.surface)
                   : static_cast<double>(tally.samples) * std::pow(filling.voxel, 3);
  };
  if (request.on_surface.value_or(true)) {
    // Small finer regions need more samples for the number of their phyxels to be foretold.
    const double least = request.grading ? 2e5 : 2e4;
    const InsideFilling filling =
        filled(prepared, sampler, request, std::clamp(1.0 * request.phyxels, least, 1e6));
    measure(filling);
    sites = place_on_surface(prepared, sampler, filling, volume, request, found, device.get());
  }
  Cloud cloud;
  SpacingField spacing(0);
  std::vector<double> gap;
  if (sites.position.empty()) {
    const double samples = samples_per_phyxel(request.phyxels);
    check_memory(request.phyxels, bytes_scattered(samples));
    InsideFilling filling = filled(prepared, sampler, request, request.phyxels * samples);
    measure(filling);
    spacing = SpacingField(std::cbrt(volume / request.phyxels));
    fill_scattered(sampler, filling, request, spacing.coarsest(), cloud);
  } else {
    spacing =
        fill_between(prepared, sampler, request, sites, volume, exact, device.get(), cloud, gap);
  }
  found.on_surface = static_cast<Index>(sites.position.size());
  report_tally(prepared, tally, found);

  const double total = std::accumulate(cloud.volume.begin(), cloud.volume.end(), 0.0);
  found.volume = exact ? volume : total;
  for (double& v : cloud.volume) v *= found.volume / total;

  if (request.grading) warn_of_no_effect(cloud, *request.grading, prepared.exponent, found);
  if (gap.empty()) gap = gaps_between(cloud.position, spacing);
  report_gaps(gap, found);
  release(gap);
  add_regions(cloud, prepared.surface, sites.position.size(), spacing.finest());
  cloud.surface = std::move(prepared.surface);
  order_along_curve(cloud);

  const int exponent = prepared.exponent;
  scale(cloud.surface.position, -exponent);
  scale(cloud.position, -exponent);
  for (double& v : cloud.volume) v = std::ldexp(v, -3 * exponent);
  for (double& s : cloud.spacing) s = std::ldexp(s, -exponent);
  for (SupportCut& cut : cloud.cuts.list) {
    cut = {cut.support.scaled(std::ldexp(1.0, -exponent)),
           cut.wall.scaled(std::ldexp(1.0, -exponent))};
  }
  cloud.cuts.depth = std::ldexp(cloud.cuts.depth, -exponent);
  cloud.cuts.spacing = std::ldexp(cloud.cuts.spacing, -exponent);
  found.volume = std::ldexp(found.volume, -3 * exponent);
  found.spacing = std::ldexp(found.spacing, -exponent);
  found.smallest_gap = std::ldexp(found.smallest_gap, -exponent);
  if (report) *report = std::move(found);
  return cloud;
}

}  // namespace phyxel
