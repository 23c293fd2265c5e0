#include "mesh/grading.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>

#include "mesh/surface_points.hpp"
#include "mesh/thickness.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Sample points on the surface for each square of the spacing of a body without grading. The two
/// sides of a place as thin as a tenth of that spacing still see each other.
constexpr double samples_on_square = 4;
/// Phyxels through a place, of which there are at least so many wherever the finest spacing allows
/// it: with fewer, phyxels on opposite sides would be nearer to each other than those side by side.
constexpr double least_across = 2;

/// An edge between two triangles that are nearly, but not quite, in one plane.
struct SmoothEdge {
  Index low, high;  ///< Vertices, as in `SurfaceEdge`.
  double angle;     ///< By which the surface turns across the edge [rad], of either sign.
  std::array<Index, 2> triangle;
};

std::vector<SmoothEdge> smooth_edges(const Surface& surface, const SurfaceTopology& topology) {
  std::vector<SmoothEdge> smooth;
  const std::vector<SurfaceEdge>& edges = topology.edges;
  for (std::size_t k = 0, next = 0; k < edges.size(); k = next) {
    while (next < edges.size() && edges[next].low == edges[k].low &&
           edges[next].high == edges[k].high) {
      ++next;
    }
    if (next - k != 2) continue;
    const Vec3d along = surface.position[edges[k].high] - surface.position[edges[k].low];
    const Vec3d a = area_of(surface, edges[k].triangle),
                b = area_of(surface, edges[k + 1].triangle);
    const double size = norm(a) * norm(b);
    if (!(size > 0) || dot(a, b) < sharp * size) continue;
    const Vec3d turn = cross(a, b);
    const double angle = std::atan2(norm(turn), dot(a, b));
    // Rounding errors of flat faces turn by less.
    if (angle < 1e-5) continue;
    const bool outward = (dot(turn, along) > 0) == edges[k].forward;
    smooth.push_back({edges[k].low,
                      edges[k].high,
                      outward ? angle : -angle,
                      {edges[k].triangle, edges[k + 1].triangle}});
  }
  return smooth;
}

/// The largest curvature of the surface at each vertex [1/m]: the largest eigenvalue, but for its
/// sign, of the tensor Σ θ l e eᵀ / A over the edges around, of which each vertex has half, and a
/// third of each triangle that is curved at all.
/// Source: Cohen-Steiner and Morvan 2003 (Restricted Delaunay triangulations and normal cycle).
std::vector<double> curvatures(const GradedBody& body, const std::vector<SmoothEdge>& edges) {
  const Surface& surface = body.surface;
  std::vector<Eigen::Matrix3d> turning(surface.position.size(), Eigen::Matrix3d::Zero());
  std::vector<double> area(surface.position.size(), 0);
  std::vector<char> counted(surface.triangle.size(), 0);
  for (const SmoothEdge& edge : edges) {
    for (const Index t : edge.triangle) {
      if (counted[t]) continue;
      counted[t] = 1;
      const double third = norm(area_of(surface, t)) / 3;
      for (const Index corner : surface.triangle[t]) area[body.topology.corner[corner]] += third;
    }
    const Vec3d along = surface.position[edge.high] - surface.position[edge.low];
    const Eigen::Vector3d e{along.x, along.y, along.z};
    const Eigen::Matrix3d half = 0.5 * edge.angle / e.norm() * e * e.transpose();
    turning[edge.low] += half;
    turning[edge.high] += half;
  }
  return tabulated(area.size(), [&](std::size_t v) {
    if (!(area[v] > 0)) return 0.0;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(turning[v], Eigen::EigenvaluesOnly);
    return solver.eigenvalues().cwiseAbs().maxCoeff() / area[v];
  });
}

/// Sources along the edges across which a surface curves: `per_radius` phyxels over the radius.
void add_curved(const GradedBody& body, double per_radius, double least, double most,
                std::vector<SpacingSource>& sources) {
  const std::vector<SmoothEdge> edges = smooth_edges(body.surface, body.topology);
  const std::vector<double> curvature = curvatures(body, edges);
  for (const SmoothEdge& edge : edges) {
    const double spacing = 1 / (per_radius * std::max(curvature[edge.low], curvature[edge.high]));
    if (!(spacing < most)) continue;
    const Vec3d from = body.surface.position[edge.low], to = body.surface.position[edge.high];
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
  // Thicker places ask for no less than the coarsest spacing, or twice the uniform one, and coarser
  // phyxels would save little.
  const double farthest = across * std::min(most, (across > 2 * least_across ? 2 : 4) * uniform);
  const std::vector<double> thickness = thicknesses(place, normal, farthest);
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (thickness[k] / across < most) sources.push_back({place[k], thickness[k] / across});
  }
}

/// Of sources that are near each other, by their spacings, one with the smallest.
std::vector<SpacingSource> thinned_out(const std::vector<SpacingSource>& sources, double least) {
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

/// Sample points inside a body or on its surface, with what sources want there.
struct WeighedPoints {
  std::vector<Vec3d> place;
  std::vector<double> of_sources;  ///< [m]
  double size = 0;                 ///< Of the part that a point stands for [m³] or [m²].

  /// The sum of `term`, of the spacing at each point.
  template <class Term>
  double sum(const SpacingField& spacing, Term&& term) const {
    const auto terms = tabulated(
        place.size(), [&](std::size_t k) { return term(spacing.at(place[k], of_sources[k])); });
    return size * std::accumulate(terms.begin(), terms.end(), 0.0);
  }
};

/// The coarsest spacing of a field for which the body has its number of phyxels, V/s³ + A/(2 s²).
double fitting_spacing(const GradedBody& body, const SpacingField& field, double area, double low,
                       double high) {
  WeighedPoints inside, on_surface;
  for (const SampleBlock& block : body.inside) {
    for (std::size_t k = 0; k < block.offset.size(); ++k) {
      inside.place.push_back(block.position(k));
    }
  }
  inside.size = std::pow(body.voxel, 3);
  for (const PointOn& p : points_over(body.surface, SpacingField(low), samples_on_square, 2)) {
    on_surface.place.push_back(p.point);
  }
  on_surface.size = area / static_cast<double>(std::max<std::size_t>(on_surface.place.size(), 1));
  for (WeighedPoints* points : {&inside, &on_surface}) {
    points->of_sources = field.of_sources(points->place);
  }
  const auto phyxels = [&](double coarsest) {
    const SpacingField tried = field.with_coarsest(coarsest);
    return inside.sum(tried, [](double s) { return 1 / (s * s * s); }) +
           on_surface.sum(tried, [](double s) { return 1 / (2 * s * s); });
  };
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (low + high);
    (phyxels(middle) > body.phyxels ? low : high) = middle;
  }
  return high;
}

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
  const bool has_finer = !request.finer.empty();
  const double per_radius = request.per_radius.value_or(has_finer ? 0 : 8),
               across = std::max(least_across, request.across.value_or(has_finer ? 0 : 5));
  if (per_radius > 0) add_curved(body, per_radius, least, most, sources);
  add_thin(body, across, uniform, most, sources);
  std::shared_ptr<const SpacingCone> cone;
  if (!sources.empty()) {
    cone = std::make_shared<SpacingCone>(thinned_out(sources, least), request.growth, least, most,
                                         box_around(body.surface.position));
  }
  std::vector<FinerRegion> regions;
  for (const Grading::Finer& finer : request.finer) regions.push_back({finer.region, finer.by});
  const SpacingField field(cone, regions, request.growth, request.ratio, uniform);
  return field.with_coarsest(fitting_spacing(body, field, area, uniform, most));
}

}  // namespace phyxel
