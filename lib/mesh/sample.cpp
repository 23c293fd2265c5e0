#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mesh/inside_filling.hpp"
#include "mesh/relaxation.hpp"
#include "mesh/surface_sites.hpp"
#include "mesh/surface_topology.hpp"
#include "model/cloud_check.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Number of sample points for each phyxel during relaxation. More samples give centroids with
/// less noise (the smallest gap is 0.70 of the spacing with 64, 0.57 with 24) and take more memory.
double samples_per_phyxel(Index phyxels) { return std::max(64.0, 20000.0 / phyxels); }

void check_memory(Index phyxels) {
  // A sample takes 16 bytes, in vectors that grow; a phyxel about 12 candidates of 40 bytes, and
  // 200 bytes in sums, hashes and results.
  const double bytes = phyxels * (24 * samples_per_phyxel(phyxels) + 12 * 40 + 200);
  const double memory =
      static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
  if (bytes > memory) {
    throw InputError(fmt::format(
        "{} phyxels need about {:.0f} GiB of memory to sample, but this machine has {:.0f} GiB; "
        "allowed here: at most about {:.2g}",
        phyxels, bytes / 0x1p30, memory / 0x1p30, phyxels * (memory / bytes)));
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

void check_request(const Surface& surface, const SampleRequest& request) {
  if (request.phyxels < 1) {
    throw InputError(fmt::format("{} phyxels asked for; at least 1 is needed", request.phyxels));
  }
  if (request.relaxations < 0) {
    throw InputError(
        fmt::format("{} relaxations asked for; 0 or more are allowed", request.relaxations));
  }
  check_memory(request.phyxels);
  if (surface.triangle.empty()) throw InputError("the surface has no triangles");
  check_surface(surface);
}

/// Multiplies positions by 2^exponent, without rounding.
void scale(std::vector<Vec3d>& position, int exponent) {
  for (Vec3d& p : position) {
    p = {std::ldexp(p.x, exponent), std::ldexp(p.y, exponent), std::ldexp(p.z, exponent)};
  }
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

/// Share of each phyxel in the volume: the number of sample points nearest to it, on voxels half as
/// large as those of the relaxation.
std::vector<double> voronoi_shares(const InsideSampler& sampler, const std::vector<Vec3d>& site,
                                   double voxel, double spacing, std::uint64_t seed,
                                   double& sampled_volume) {
  Stage stage("volumes of phyxels");
  const NearestSite nearest(site, spacing);
  std::vector<std::uint32_t> count(site.size(), 0);
  const SampleTally tally = sampler.visit(
      0.5 * voxel, seed,
      [&](std::size_t, const SampleBlock& b) {
        thread_local NearestSite::Scratch scratch;
        nearest.find(b, scratch);
        for (const Index i : scratch.owner) {
#pragma omp atomic
          ++count[i];
        }
      },
      &stage);
  sampled_volume = static_cast<double>(tally.samples) * std::pow(0.5 * voxel, 3);
  std::vector<double> share(site.size());
  // A phyxel without sample points gets the volume of half a sample.
  for (std::size_t i = 0; i < site.size(); ++i) share[i] = std::max(0.5, double(count[i]));
  stage.finish();
  return share;
}

/// Sets the mean and the smallest distance to the nearest phyxel [m]; zero for a single phyxel.
void measure_gaps(const std::vector<Vec3d>& site, double spacing, SampleReport& report) {
  const auto n = static_cast<std::ptrdiff_t>(site.size());
  if (n < 2) return;
  const SpatialHash hash(site, spacing);
  std::vector<double> gap(site.size());
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    double nearest2 = HUGE_VAL;
    const auto compare = [&](const SpatialHash::Entry& entry) {
      if (entry.index == i) return;
      const Vec3d d = entry.position - site[i];
      nearest2 = std::min(nearest2, dot(d, d));
    };
    const double cell = hash.cell_size();
    // After rings 0 to r, each site nearer than r cells has been visited.
    int ring = 0;
    for (; ring < 4; ++ring) {
      hash.visit_ring(site[i], ring, compare);
      if (nearest2 <= ring * cell * ring * cell) break;
    }
    if (ring == 4) hash.visit_all(compare);
    gap[i] = std::sqrt(nearest2);
  }
  report.spacing = std::accumulate(gap.begin(), gap.end(), 0.0) / static_cast<double>(n);
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

/// Adds to `site` the phyxels that lie on the surface, if the request and the surface allow them.
/// @param spacing cube root of the volume of a phyxel [m], adjusted to the phyxels on the surface
void place_on_surface(const PreparedSurface& prepared, const SampleTally& tally, double volume,
                      const SampleRequest& request, std::vector<Vec3d>& site, double& spacing,
                      SampleReport& found) {
  if (!request.on_surface.value_or(true)) return;
  try {
    refuse_surface_phyxels(tally, prepared.topology.closed, prepared.defects);
    SurfaceSites sites = sites_on(prepared.surface, prepared.topology, volume, request.phyxels,
                                  request.seed + 3, request.relaxations);
    site = std::move(sites.position);
    spacing = sites.spacing;
  } catch (const InputError& error) {
    if (request.on_surface) throw;
    found.warnings.push_back(fmt::format("all phyxels lie inside: {}", error.what()));
  }
}

/// Moves sites that relaxation has left outside to a sample point of their cells: in a thin or
/// hollow body, the centroid of a cell may lie outside. The first `fixed` sites stay.
void bring_inside(const InsideSampler& sampler, SampledVoronoi& voronoi, std::vector<Vec3d>& site,
                  double spacing, std::size_t fixed) {
  std::vector<std::uint8_t> outside(site.size());
  const auto n = static_cast<std::ptrdiff_t>(site.size());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::ptrdiff_t i = static_cast<std::ptrdiff_t>(fixed); i < n; ++i) {
    outside[i] = !sampler.inside(site[i]);
  }
  if (std::count(outside.begin(), outside.end(), 1) > 0) {
    voronoi.snap(site, spacing, outside, fixed);
  }
}

}  // namespace

Cloud sample_surface(const Surface& surface, const SampleRequest& request, SampleReport* report) {
  check_request(surface, request);
  SampleReport found;
  PreparedSurface prepared = prepare(surface, found);
  const bool closed = prepared.topology.closed;
  const InsideSampler sampler(prepared.surface, closed);

  const std::uint64_t seed = request.seed;
  InsideFilling filling;
  fill_inside(sampler,
              {.phyxels = request.phyxels,
               .samples = request.phyxels * samples_per_phyxel(request.phyxels),
               .seed = seed,
               .triangles = prepared.surface.triangle.size(),
               .volume = closed ? std::optional(enclosed_volume(prepared.surface)) : std::nullopt,
               .exponent = prepared.exponent,
               .defects = prepared.defects},
              filling);
  const SampleTally& tally = filling.tally;
  const double voxel = filling.voxel;
  refuse_if_too_open(tally, found.defects, closed);
  found.doubtful_fraction =
      static_cast<double>(tally.doubtful) / static_cast<double>(tally.samples);
  if (!closed) {
    found.warnings.push_back(fmt::format(
        "the surface is not closed ({}); {:.2g}% of the interior points have an ambiguous winding "
        "number",
        prepared.defects, 100 * found.doubtful_fraction));
  }

  Cloud cloud;
  const double rough_volume = static_cast<double>(tally.samples) * std::pow(voxel, 3);
  double spacing = std::cbrt(rough_volume / request.phyxels);
  place_on_surface(prepared, tally, rough_volume, request, cloud.position, spacing, found);
  const std::size_t on_surface = cloud.position.size();
  found.on_surface = static_cast<Index>(on_surface);
  const std::vector<Vec3d> within = throw_darts(filling.blocks, request.phyxels - found.on_surface,
                                                spacing, seed + 1, cloud.position);
  cloud.position.insert(cloud.position.end(), within.begin(), within.end());
  SampledVoronoi voronoi(std::move(filling.blocks));
  voronoi.relax(cloud.position, spacing, request.relaxations, on_surface);
  bring_inside(sampler, voronoi, cloud.position, spacing, on_surface);

  double sampled_volume = 0;
  cloud.volume = voronoi_shares(sampler, cloud.position, voxel, spacing, seed + 2, sampled_volume);
  // The divergence theorem counts regions with a winding number of two twice.
  const bool exact = closed && tally.repeated == 0;
  found.volume = exact ? enclosed_volume(prepared.surface) : sampled_volume;
  if (tally.repeated > 0) {
    found.warnings.push_back(fmt::format(
        "the surface overlaps itself: {:.2g}% of the inside has a winding number above 1, and "
        "counts once",
        100 * static_cast<double>(tally.repeated) / static_cast<double>(tally.samples)));
  }
  const double total = std::accumulate(cloud.volume.begin(), cloud.volume.end(), 0.0);
  for (double& v : cloud.volume) v *= found.volume / total;

  measure_gaps(cloud.position, spacing, found);
  cloud.surface = std::move(prepared.surface);
  order_along_curve(cloud);

  const int exponent = prepared.exponent;
  scale(cloud.surface.position, -exponent);
  scale(cloud.position, -exponent);
  for (double& v : cloud.volume) v = std::ldexp(v, -3 * exponent);
  found.volume = std::ldexp(found.volume, -3 * exponent);
  found.spacing = std::ldexp(found.spacing, -exponent);
  found.smallest_gap = std::ldexp(found.smallest_gap, -exponent);
  if (report) *report = std::move(found);
  return cloud;
}

}  // namespace phyxel
