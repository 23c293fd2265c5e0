#include "mesh/surface_sites.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mesh/cuts.hpp"
#include "mesh/darts.hpp"
#include "mesh/face_relaxation.hpp"
#include "mesh/grading.hpp"
#include "mesh/relaxation.hpp"
#include "mesh/repulsion.hpp"
#include "mesh/surface_points.hpp"
#include "model/box.hpp"
#include "model/host_memory.hpp"
#include "parallel_sort.hpp"
#include "phyxel/error.hpp"
#include "tabulated.hpp"
#include "timeline.hpp"

namespace phyxel {
namespace {

/// Area, in squares of the longest side, below which a triangle's normal is rounding error.
constexpr double no_area = 1e-12;
/// Number of sample points for each site along an edge and on a face.
constexpr double samples_along_edges = 64, samples_on_faces = 32;
/// Memory that a sample point on a face takes while sites are selected [bytes].
constexpr double bytes_per_sample = 150;
/// Smallest distances between random sites, in spacings, that give about one site for each spacing
/// of an edge and for each square spacing of a face.
constexpr double gap_at_corners = 0.5, gap_along_edges = 0.75, gap_on_faces = 0.79;

struct Features {
  std::vector<PointOn> corners;  ///< Corners, with the indices of their vertices.
  std::vector<Crease> creases;
};

Features features_of(const Surface& surface, const SurfaceTopology& topology) {
  Features features;
  std::vector<std::vector<Vec3d>> leaving(surface.position.size());  // sharp edges, as unit vectors
  const std::vector<SurfaceEdge>& edges = topology.edges;
  for (std::size_t k = 0, next = 0; k < edges.size(); k = next) {
    while (next < edges.size() && edges[next].low == edges[k].low &&
           edges[next].high == edges[k].high) {
      ++next;
    }
    const Vec3d from = surface.position[edges[k].low], to = surface.position[edges[k].high];
    const double length = norm(to - from);
    bool is_sharp = next - k != 2;
    if (!is_sharp) {
      const Vec3d a = area_of(surface, edges[k].triangle),
                  b = area_of(surface, edges[k + 1].triangle);
      // A degenerate triangle, as mesh repair leaves along edges, hides the angle of its
      // neighbours.
      const double size = norm(a) * norm(b), least = no_area * length * length;
      is_sharp = norm(a) <= least || norm(b) <= least || dot(a, b) < sharp * size;
    }
    if (!is_sharp || !(length > 0)) continue;
    features.creases.push_back({from, to});
    leaving[edges[k].low].push_back((to - from) / length);
    leaving[edges[k].high].push_back((from - to) / length);
  }
  for (std::size_t v = 0; v < leaving.size(); ++v) {
    const std::vector<Vec3d>& at = leaving[v];
    if (at.empty()) continue;
    // A sharp edge that continues leaves the vertex in two opposite directions, each of which
    // several edges may share.
    bool back = false, other = false;
    for (const Vec3d& direction : at) {
      const double along = dot(direction, at[0]);
      back = back || along < -sharp;
      other = other || std::abs(along) <= sharp;
    }
    if (other || !back) features.corners.push_back({v, surface.position[v]});
  }
  return features;
}

/// Groups neighbouring points of a piece into blocks. Points of a plane perpendicular to an axis
/// stay exactly on it.
std::vector<SampleBlock> blocks_of(std::span<const PointOn> points, double side) {
  struct Placed {
    std::array<std::int64_t, 4> cell;  // with the piece
    std::size_t number;                // of the point
    bool operator<(const Placed& other) const {
      return cell == other.cell ? number < other.number : cell < other.cell;
    }
  };
  const auto cell = [&](double v) { return static_cast<std::int64_t>(std::floor(v / side)); };
  auto placed = in_bulk(points.size(), [&](std::size_t k) {
    const auto& [piece, p] = points[k];
    return Placed{{cell(p.x), cell(p.y), cell(p.z), static_cast<std::int64_t>(piece)}, k};
  });
  parallel_sort(placed);
  std::vector<std::size_t> first;  // of each block
  for (std::size_t k = 0; k < placed.size(); ++k) {
    if (k == 0 || placed[k].cell != placed[k - 1].cell) first.push_back(k);
  }
  std::vector<SampleBlock> blocks(first.size());
  first.push_back(placed.size());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    blocks[b].centre = points[placed[first[b]].number].point;
    blocks[b].offset.reserve(first[b + 1] - first[b]);
    for (std::size_t k = first[b]; k < first[b + 1]; ++k) {
      blocks[b].offset.push_back(to<float>(points[placed[k].number].point - blocks[b].centre));
    }
  }
  return blocks;
}

/// Points evenly spread along pieces of edges, `samples_along_edges` on each spacing.
std::vector<PointOn> points_along(const std::vector<Crease>& creases, const SpacingField& spacing) {
  std::vector<PointOn> points;
  const double one = spacing.is_uniform() ? spacing.coarsest() : 1;
  Shares shares(one / samples_along_edges);
  const auto add = [&](std::size_t e, Vec3d from, Vec3d along, double size) {
    const std::int64_t n = shares.next(size);
    for (std::int64_t k = 0; k < n; ++k) {
      points.push_back(
          {e, from + ((static_cast<double>(k) + 0.5) / static_cast<double>(n)) * along});
    }
  };
  for (std::size_t e = 0; e < creases.size(); ++e) {
    const Vec3d from = creases[e].from, along = creases[e].to - from;
    const double length = norm(along);
    if (spacing.is_uniform()) {
      add(e, from, along, length);
      continue;
    }
    // Stretches on which the spacing is nearly one.
    for (double at = 0; at < length;) {
      const double here = spacing.at(from + (at / length) * along),
                   end = std::min(length, at + 0.25 * here);
      add(e, from + (at / length) * along, ((end - at) / length) * along, (end - at) / here);
      at = end;
    }
  }
  return points;
}

/// The points that are not in a margin, in their order.
std::vector<PointOn> outside(const CutMargin& margin, std::span<const PointOn> points) {
  const auto n = static_cast<std::ptrdiff_t>(points.size());
  std::vector<char> is_outside(points.size());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::ptrdiff_t k = 0; k < n; ++k) is_outside[k] = !margin.contains(points[k].point);
  std::vector<PointOn> kept;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (is_outside[k]) kept.push_back(points[k]);
  }
  return kept;
}

/// Adds sites at random points of edges outside the margin and relaxes them; the sites of the
/// argument stay.
void add_along_edges(std::vector<Vec3d>& site, const std::vector<Crease>& creases,
                     const SpacingField& spacing, const CutMargin& margin, std::uint64_t seed,
                     int relaxations) {
  const std::size_t fixed = site.size();
  const std::vector<PointOn> points = outside(margin, points_along(creases, spacing));
  std::vector<SampleBlock> blocks = blocks_of(points, spacing.coarsest());
  const std::vector<Vec3d> more = fill_with_darts(blocks, spacing, gap_along_edges, seed, site);
  if (more.empty()) return;
  site.insert(site.end(), more.begin(), more.end());
  if (!spacing.is_uniform()) {
    relax_on_edges(creases, points, site, fixed, spacing, margin, repulsion_sweeps(relaxations));
    return;
  }
  SampledVoronoi voronoi(std::move(blocks));
  voronoi.relax(site, spacing.coarsest(), relaxations, fixed);
  // The centroids of cells of curved edges and faces lie off the surface.
  std::vector<std::uint8_t> which(site.size(), 1);
  std::fill_n(which.begin(), fixed, 0);
  voronoi.snap(site, spacing.coarsest(), which, fixed);
}

/// Adds sites at random points of faces outside the margin and relaxes them; the sites of the
/// argument stay.
void add_on_faces(const Surface& surface, std::vector<Vec3d>& site, const SpacingField& spacing,
                  const CutMargin& margin, std::uint64_t seed, int relaxations, Stage& stage,
                  const SurfaceOnDevice* device) {
  const std::size_t fixed = site.size();
  const Bulk<PointOn> sample = points_over(surface, spacing, samples_on_faces, seed);
  {
    const Phase phase("darts on the surface");
    const auto add = [&](std::span<const PointOn> free) {
      const std::vector<Vec3d> more = fill_with_darts(blocks_of(free, spacing.coarsest()), spacing,
                                                      gap_on_faces, seed + 1, site, device);
      site.insert(site.end(), more.begin(), more.end());
    };
    if (margin.is_empty()) {
      add(sample);
    } else {
      add(outside(margin, sample));
    }
  }
  const Phase phase("evening out the surface");
  relax_on_faces(surface, sample, site, fixed, spacing, margin, repulsion_sweeps(relaxations),
                 stage, device);
}

/// Moves the sites from `first` on, which lie on the boundaries of regions, into these by `depth`
/// [m].
void settle_on_cuts(std::vector<Vec3d>& site, std::size_t first, std::span<const SpaceRegion> cuts,
                    double depth) {
  for (std::size_t i = first; i < site.size(); ++i) {
    const auto nearer = [&](const SpaceRegion& a, const SpaceRegion& b) {
      return std::abs(a.distance(site[i])) < std::abs(b.distance(site[i]));
    };
    const SpaceRegion& cut = *std::min_element(cuts.begin(), cuts.end(), nearer);
    site[i] = cut.nearest_on_boundary(site[i], depth);
  }
}

/// The finest spacing on the part of a region's boundary that lies in a body [m].
double finest_on(const SpacingField& spacing, const InsideSampler& sampler,
                 const SpaceRegion& region) {
  if (spacing.is_uniform()) return spacing.coarsest();
  double finest = spacing.coarsest();
  for (const Vec3d p : points_on_cut(sampler, region, sampler.extent() / 64, 1)) {
    finest = std::min(finest, spacing.at(p));
  }
  return finest;
}

/// The parts of the boundaries of regions that lie in a body.
std::vector<CutFace> faces_of(std::span<const SpaceRegion> boundaries, const Surface& surface,
                              const InsideSampler& sampler, const SpacingField& spacing,
                              std::uint64_t seed) {
  std::vector<CutFace> faces;
  for (const SpaceRegion& cut : boundaries) {
    const double gap = finest_on(spacing, sampler, cut) / std::sqrt(samples_on_faces);
    faces.push_back({cut, points_on_cut(sampler, cut, gap, seed), gap,
                     cutting_curves(surface, cut, 0.5 * spacing.finest())});
  }
  return faces;
}

/// Adds sites where sharp edges cross the boundaries of regions.
void add_crossings(SurfaceSites& sites, const std::vector<Crease>& creases, std::uint64_t seed) {
  const SpacingField& spacing = sites.spacing;
  std::vector<PointOn> points;
  for (const Vec3d p : crossings(creases, sites.boundaries, 0.5 * spacing.finest()))
    points.push_back({0, p});
  if (points.empty()) return;
  std::vector<Vec3d>& site = sites.position;
  const std::size_t first = site.size();
  const std::vector<Vec3d> more =
      fill_with_darts(blocks_of(points, spacing.coarsest()), spacing, gap_at_corners, seed, site);
  site.insert(site.end(), more.begin(), more.end());
  settle_on_cuts(site, first, sites.boundaries, sites.cuts.depth);
}

/// Adds sites along the curves on a surface in which the boundaries of regions cut it.
void add_along_cuts(std::span<const CutFace> faces, const InsideSampler& sampler,
                    SurfaceSites& sites, std::uint64_t seed, int relaxations) {
  const SpacingField& spacing = sites.spacing;
  const CutMargin no_margin(sampler, {}, spacing);
  std::vector<Crease> curves;
  for (const CutFace& face : faces) {
    curves.insert(curves.end(), face.border.piece.begin(), face.border.piece.end());
  }
  if (curves.empty()) return;
  const std::size_t first = sites.position.size();
  add_along_edges(sites.position, curves, spacing, no_margin, seed, relaxations);
  settle_on_cuts(sites.position, first, sites.boundaries, sites.cuts.depth);
}

/// Adds sites on the boundary of a region inside a surface, at most `most` with those there are.
void add_on_cut(const InsideSampler& sampler, const CutFace& face, SurfaceSites& sites, double most,
                std::uint64_t seed, int relaxations) {
  const SpacingField& spacing = sites.spacing;
  if (face.points.empty()) return;
  std::vector<PointOn> samples;
  for (const Vec3d p : face.points) samples.push_back({0, p});
  std::vector<Vec3d> all = sites.position;
  all.insert(all.end(), sites.on_cuts.begin(), sites.on_cuts.end());
  const std::size_t first = all.size();
  const std::vector<Vec3d> more =
      fill_with_darts(blocks_of(samples, spacing.coarsest()), spacing, gap_on_faces, seed, all);
  // A boundary that two regions share has its sites already.
  if (more.empty() || static_cast<double>(sites.on_cuts.size() + more.size()) > 0.75 * most) return;
  all.insert(all.end(), more.begin(), more.end());
  relax_on_cut(face.region, sampler, all, first, spacing, repulsion_sweeps(relaxations));
  settle_on_cuts(all, first, {&face.region, 1}, sites.cuts.depth);
  sites.on_cuts.insert(sites.on_cuts.end(), all.begin() + static_cast<std::ptrdiff_t>(first),
                       all.end());
  sites.cut_points.insert(sites.cut_points.end(), face.points.begin(), face.points.end());
  sites.cut_area += face.gap * face.gap * static_cast<double>(face.points.size());
}

/// The area of a surface in squares of the spacing.
double squares_on(const Surface& surface, const SpacingField& spacing) {
  const std::vector<Vec3d> middle = tabulated(surface.triangle.size(), [&](std::size_t t) {
    const Triangle& corner = surface.triangle[t];
    return (surface.position[corner[0]] + surface.position[corner[1]] +
            surface.position[corner[2]]) /
           3.0;
  });
  const std::vector<double> wanted = spacing.at(middle);
  double squares = 0;
  for (std::size_t t = 0; t < middle.size(); ++t) {
    squares += norm(area_of(surface, static_cast<Index>(t))) / (wanted[t] * wanted[t]);
  }
  return squares;
}

/// A subset of the corners that are not too near to each other or to a cut [m].
std::vector<Vec3d> corners_of(const Features& features, const SpacingField& spacing,
                              const CutMargin& margin, std::uint64_t seed) {
  const std::vector<SampleBlock> blocks =
      blocks_of(outside(margin, features.corners), spacing.coarsest());
  std::vector<Vec3d> site = fill_with_darts(blocks, spacing, gap_at_corners, seed, {});
  if (site.empty()) return site;
  // Sample offsets are rounded to float; this restores the exact corners.
  SampledVoronoi(blocks).snap(site, spacing.coarsest(), std::vector<std::uint8_t>(site.size(), 1),
                              0);
  return site;
}

}  // namespace

SurfaceSites sites_on(const Surface& surface, const SurfaceTopology& topology, double volume,
                      const SpacingField& wanted, const InsideSampler& sampler,
                      std::span<const SpaceRegion> regions, Index phyxels, std::uint64_t seed,
                      int relaxations, Stage& stage, const SurfaceOnDevice* device) {
  const double area = sampler.area();
  const Features features = features_of(surface, topology);
  const double rounding =
      16 * std::numeric_limits<double>::epsilon() * box_around(surface.position).farthest();
  SurfaceSites found;
  found.spacing = wanted;
  for (int attempt = 0; attempt < 8; ++attempt) {
    const SpacingField s = found.spacing;
    if (s.finest() > 2 * volume / area) break;
    require_host_memory("phyxels on a surface", phyxels,
                        bytes_per_sample * samples_on_faces * squares_on(surface, s) / phyxels);
    found.cuts = {
        .list = {}, .depth = 1e-7 * s.finest() + rounding, .spacing = s.coarsest(), .shift = 0};
    found.boundaries.clear();
    for (const SpaceRegion& region : regions) {
      const PlannedCut planned = plan_cut(sampler, surface, region, finest_on(s, sampler, region));
      if (planned.is_cut) found.boundaries.push_back(planned.boundary);
      if (planned.has_inside) found.cuts.list.push_back({region, planned.boundary});
    }
    const std::vector<CutFace> faces = faces_of(found.boundaries, surface, sampler, s, seed + 3);
    const CutMargin margin(sampler, faces, s);
    found.position = corners_of(features, s, margin, seed);
    add_crossings(found, features.creases, seed);
    add_along_edges(found.position, features.creases, s, margin, seed, relaxations);
    add_along_cuts(faces, sampler, found, seed + 2, relaxations);
    add_on_faces(surface, found.position, s, margin, seed + 1, relaxations, stage, device);
    // At least a quarter of the phyxels of a lattice without surface must remain for the inside.
    const double inside = static_cast<double>(phyxels) - static_cast<double>(found.position.size());
    const double least_inside = s.is_uniform() ? 0.25 * volume / std::pow(s.coarsest(), 3)
                                               : 0.1 * static_cast<double>(phyxels);
    if (inside > least_inside) {
      for (const CutFace& face : faces) {
        add_on_cut(sampler, face, found, inside, seed + 4, relaxations);
      }
      return found;
    }
    found.spacing = s.with_coarsest(1.1 * s.coarsest());
  }
  const double thickness = 2 * volume / area;
  throw InputError(fmt::format(
      "{} phyxels are too few for some to lie on the surface: those on opposite sides would be "
      "nearer to each other than those side by side; allowed: about {:.2g} or more, or all of them "
      "inside",
      phyxels, 1.5 * area / (thickness * thickness)));
}

}  // namespace phyxel
