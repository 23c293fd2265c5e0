#include "mesh/grading.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "mesh/surface_points.hpp"
#include "model/box.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {
namespace {

/// Sample points on the surface for each square of the spacing of a body without grading: a place
/// as thin as a third of that spacing is still seen.
constexpr double samples_on_square = 16;
/// Cosine between the outward normals of two faces from which they are two sides of a thin place.
constexpr double opposite = -0.6;

/// The nearest of the two ends, or a place between them.
struct SmoothEdge {
  Vec3d from, to;  ///< [m]
  double radius;   ///< Of the curvature across the edge [m].
};

/// The smooth edges across which a surface curves. The radius is the distance across the two
/// triangles, half of each, over the angle between them.
std::vector<SmoothEdge> curved_edges(const Surface& surface, const SurfaceTopology& topology) {
  std::vector<SmoothEdge> curved;
  const std::vector<SurfaceEdge>& edges = topology.edges;
  for (std::size_t k = 0, next = 0; k < edges.size(); k = next) {
    while (next < edges.size() && edges[next].low == edges[k].low &&
           edges[next].high == edges[k].high) {
      ++next;
    }
    if (next - k != 2) continue;
    const Vec3d from = surface.position[edges[k].low], to = surface.position[edges[k].high];
    const Vec3d a = area_of(surface, edges[k].triangle),
                b = area_of(surface, edges[k + 1].triangle);
    const double length = norm(to - from), size = norm(a) * norm(b);
    if (!(size > 0) || !(length > 0)) continue;
    const double cosine = dot(a, b) / size, sine = norm(cross(a, b)) / size;
    if (cosine < sharp) continue;
    const double angle = std::atan2(sine, cosine), across = (norm(a) + norm(b)) / length;
    if (angle > 1e-6) curved.push_back({from, to, across / angle});
  }
  return curved;
}

/// Sources along the edges across which a surface curves: `per_radius` phyxels over the radius.
void add_curved(const GradedBody& body, double per_radius, double least, double most,
                std::vector<SpacingSource>& sources) {
  for (const auto& [from, to, radius] : curved_edges(body.surface, body.topology)) {
    const double spacing = radius / per_radius;
    if (spacing >= most) continue;
    const double step = 2 * std::max(spacing, least);
    const auto pieces = static_cast<int>(std::ceil(std::min(norm(to - from) / step, 1e4)));
    for (int k = 0; k < pieces; ++k) {
      sources.push_back({from + ((k + 0.5) / pieces) * (to - from), spacing});
    }
  }
}

/// Sources on both sides of thin places: `across` phyxels through them.
void add_thin(const GradedBody& body, double across, double uniform, double most,
              std::vector<SpacingSource>& sources) {
  const Bulk<PointOn> points =
      points_over(body.surface, SpacingField(uniform), samples_on_square, 1);
  std::vector<Vec3d> place(points.size()), normal(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    place[k] = points[k].point;
    normal[k] = normalised(area_of(body.surface, static_cast<Index>(points[k].piece)));
  }
  const SpatialHash hash(place, 0.5 * uniform);
  // Thicker places ask for no less than the coarsest spacing, or three times the uniform one, which
  // is more than grading makes of most.
  const double farthest = across * std::min(most, 3 * uniform);
  std::vector<double> thickness(points.size(), HUGE_VAL);
#pragma omp parallel for schedule(dynamic, 256)
  for (std::size_t k = 0; k < points.size(); ++k) {
    for (double reach = uniform; !(thickness[k] < HUGE_VAL); reach *= 2) {
      reach = std::min(reach, farthest);
      double nearest = reach * reach;
      hash.visit_ball(place[k], reach, [&](const SpatialHash::Entry& e) {
        const Vec3d apart = place[k] - e.position;
        const double through = dot(apart, normal[k]), distance2 = dot(apart, apart);
        if (distance2 > nearest || !(through > 0.1 * std::sqrt(distance2))) return;
        if (dot(normal[k], normal[e.index]) > opposite) return;
        nearest = distance2;
        thickness[k] = through;
      });
      if (reach == farthest) break;
    }
  }
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (thickness[k] / across < most) sources.push_back({place[k], thickness[k] / across});
  }
}

/// Leaves of sources that are near each other, by their spacings, the smallest.
std::vector<SpacingSource> thinned_out(std::vector<SpacingSource> sources, double least) {
  using Cell = std::tuple<int, std::int64_t, std::int64_t, std::int64_t>;
  std::map<Cell, SpacingSource> kept;
  for (SpacingSource source : sources) {
    source.spacing = std::max(source.spacing, 0.5 * least);
    const int octave = std::ilogb(source.spacing);
    const double side = std::ldexp(0.5, octave);
    const auto cell = [&](double v) { return static_cast<std::int64_t>(std::floor(v / side)); };
    const auto [at, is_new] = kept.try_emplace(
        Cell{octave, cell(source.place.x), cell(source.place.y), cell(source.place.z)}, source);
    if (!is_new && source.spacing < at->second.spacing) at->second = source;
  }
  std::vector<SpacingSource> left;
  for (const auto& [cell, source] : kept) left.push_back(source);
  return left;
}

/// Number of phyxels for a spacing that changes: V/s³ + A/(2 s²).
class Expected {
 public:
  Expected(const GradedBody& body, double uniform) : cell_(std::pow(body.voxel, 3)) {
    for (const SampleBlock& block : body.inside) {
      for (std::size_t k = 0; k < block.offset.size(); ++k) inside_.push_back(block.position(k));
    }
    double area = 0;
    for (std::size_t t = 0; t < body.surface.triangle.size(); ++t) {
      area += norm(area_of(body.surface, static_cast<Index>(t)));
    }
    for (const PointOn& p : points_over(body.surface, SpacingField(uniform), samples_on_square, 2)) {
      on_surface_.push_back(p.point);
    }
    square_ = area / static_cast<double>(std::max<std::size_t>(on_surface_.size(), 1));
  }

  double phyxels(const SpacingField& spacing) const {
    const auto sum = [](const std::vector<Vec3d>& points, auto&& term) {
      std::vector<double> terms(points.size());
#pragma omp parallel for schedule(static)
      for (std::size_t k = 0; k < points.size(); ++k) terms[k] = term(points[k]);
      double all = 0;
      for (const double t : terms) all += t;
      return all;
    };
    return sum(inside_,
               [&](Vec3d p) {
                 const double s = spacing.at(p);
                 return cell_ / (s * s * s);
               }) +
           sum(on_surface_, [&](Vec3d p) {
             const double s = spacing.at(p);
             return square_ / (2 * s * s);
           });
  }

 private:
  double cell_, square_;
  std::vector<Vec3d> inside_, on_surface_;
};

}  // namespace

double spacing_for(double volume, double area, Index phyxels) {
  double low = std::cbrt(volume / phyxels), high = low;
  const auto needed = [&](double s) { return volume / (s * s * s) + area / (2 * s * s); };
  while (needed(high) > phyxels) high *= 2;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (needed(middle) > phyxels ? low : high) = middle;
  }
  return high;
}

SpacingField graded_spacing(const GradedBody& body, const Grading& request) {
  double samples = 0, area = 0;
  for (const SampleBlock& block : body.inside) samples += static_cast<double>(block.offset.size());
  for (std::size_t t = 0; t < body.surface.triangle.size(); ++t) {
    area += norm(area_of(body.surface, static_cast<Index>(t)));
  }
  const double uniform = spacing_for(samples * std::pow(body.voxel, 3), area, body.phyxels);
  // If all were as fine as can be, the finest spacing would be the uniform one.
  const double most = request.ratio * uniform, least = uniform / request.ratio;
  std::vector<SpacingSource> sources;
  if (request.per_radius > 0) add_curved(body, request.per_radius, least, most, sources);
  if (request.across > 0) add_thin(body, request.across, uniform, most, sources);
  std::shared_ptr<const SpacingCone> cone;
  if (!sources.empty()) {
    cone = std::make_shared<SpacingCone>(thinned_out(std::move(sources), least), request.growth,
                                         least, most);
  }
  std::vector<FinerRegion> regions;
  for (const Grading::Finer& finer : request.finer) regions.push_back({finer.region, finer.by});
  const SpacingField field(cone, regions, request.growth, request.ratio, uniform);
  const Expected expected(body, uniform);
  double low = uniform, high = most;
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (low + high);
    (expected.phyxels(field.with_coarsest(middle)) > body.phyxels ? low : high) = middle;
  }
  return field.with_coarsest(high);
}

}  // namespace phyxel
