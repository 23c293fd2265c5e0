#include "model/closing_areas.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

void add_facets(std::vector<Facet>& facets, Vec3d a, Vec3d b, Vec3d c, double longest) {
  const double ab = norm(b - a), bc = norm(c - b), ca = norm(a - c);
  if (std::max({ab, bc, ca}) <= longest) {
    facets.push_back({(a + b + c) / 3.0, 0.5 * cross(b - a, c - a)});
  } else if (ab >= bc && ab >= ca) {
    const Vec3d middle = 0.5 * (a + b);
    add_facets(facets, a, middle, c, longest);
    add_facets(facets, middle, b, c, longest);
  } else {
    add_facets(facets, b, c, a, longest);  // the longest comes first within two turns
  }
}

/// Largest sum of the sizes of a facet's shares among phyxels in its plane. More means that some
/// are large and of both signs, since the phyxels lie nearly in a line, or all on one side: as on
/// curved surfaces, where few are in the plane of a facet by chance.
constexpr double most_shares = 1.2;

}  // namespace

double facet_support(std::span<const double> support, double pair_length) {
  const auto [least, most] = std::minmax_element(support.begin(), support.end());
  return pair_length > 0 ? *least : *most;
}

double longest_edge(double support, std::span<const Vec3d> position,
                    std::span<const Triangle> triangles, Index first, Index size) {
  double area = 0;
  for (const Triangle& t : triangles) {
    const Vec3d a = position[t[0] - first];
    area += 0.5 * norm(cross(position[t[1] - first] - a, position[t[2] - first] - a));
  }
  return std::max(0.5 * support, std::sqrt(area / (25.0 * size)));
}

std::vector<Facet> facets_of(std::span<const Vec3d> position, std::span<const Triangle> triangles,
                             Index first, double longest) {
  std::vector<Facet> facets;
  for (const Triangle& t : triangles) {
    add_facets(facets, position[t[0] - first], position[t[1] - first], position[t[2] - first],
               longest);
  }
  return facets;
}

Enclosed enclosed_by(std::span<const Facet> facets) {
  Enclosed found;
  if (facets.empty()) return found;
  Vec3d sum;
  Mat3d moment{};
  double area = 0;
  for (const Facet& f : facets) {
    sum += f.area;
    area += norm(f.area);
    moment = fused_outer(f.centroid - facets[0].centroid, f.area, moment);
  }
  found.volume = (moment(0, 0) + moment(1, 1) + moment(2, 2)) / 3;
  found.open = area > 0 ? norm(sum) / area : 1;
  for (int e = 0; e < 9; ++e) {
    const double off = moment(e / 3, e % 3) - (e % 4 == 0 ? found.volume : 0);
    found.open = std::max(found.open, std::abs(off / found.volume));
  }
  return found;
}

std::vector<Vec3d> areas_of_phyxels(std::span<const Facet> facets, const Csr& near,
                                    std::span<const Vec3d> position,
                                    std::span<const double> support) {
  const std::vector<Vec3d> areas =
      tabulated(facets.size(), [&](std::size_t f) { return facets[f].area; });
  return distribute(facets, areas, near, position, support);
}

std::vector<Vec3d> distribute(std::span<const Facet> facets, std::span<const Vec3d> value,
                              const Csr& near, std::span<const Vec3d> position,
                              std::span<const double> support) {
  std::vector<double> share(near.indices.size());
#pragma omp parallel for schedule(static)
  for (Index f = 0; f < near.rows(); ++f) {
    const Facet& facet = facets[f];
    const double area = norm(facet.area);
    const Vec3d normal = area > 0 ? facet.area / area : Vec3d{};
    const auto x_of = [&](Index i) { return position[i] - facet.centroid; };
    const auto weigh = [&](bool in_plane) {
      // Moments about the weighted mean: 1 and x - mean are then orthogonal.
      double sum = 0;
      Vec3d first;
      const auto weight_of = [&](Index i) {
        const Vec3d x = x_of(i);
        const double h = support[i];
        // Whole units of rounding: a lattice's nodes are put on its faces by arithmetic.
        if (in_plane && std::abs(dot(x, normal)) > 1e-6 * h) return 0.0;
        return weight_shape(dot(x, x), 1 / (h * h));
      };
      for (const Index i : near.row(f)) {
        sum += weight_of(i);
        first += weight_of(i) * x_of(i);
      }
      if (!(sum > 0)) return -1;
      const Vec3d mean = first / sum;
      Sym3d moment;
      for (const Index i : near.row(f)) moment += moment_term(x_of(i) - mean, weight_of(i));
      const PseudoInverse<double> inverse = pseudo_inverse(moment);
      const Vec3d slope = inverse.matrix * mean;
      for (Offset k = near.offsets[f]; k < near.offsets[f + 1]; ++k) {
        const Index i = near.indices[k];
        share[k] = weight_of(i) * (1 / sum - dot(slope, x_of(i) - mean));
      }
      return inverse.rank;
    };
    if (weigh(true) == 2) {
      double all = 0;
      for (Offset k = near.offsets[f]; k < near.offsets[f + 1]; ++k) all += std::abs(share[k]);
      if (all <= most_shares) continue;
    }
    if (weigh(false) < 0) {  // only the nearest, beyond its support
      for (Offset k = near.offsets[f]; k < near.offsets[f + 1]; ++k) {
        share[k] = 1.0 / near.length(f);
      }
    }
  }
  std::vector<Vec3d> sums(position.size());
  for (Index f = 0; f < near.rows(); ++f) {
    for (Offset k = near.offsets[f]; k < near.offsets[f + 1]; ++k) {
      sums[near.indices[k]] += share[k] * value[f];
    }
  }
  return sums;
}

namespace {

/// Why the gradients of a body with this surface cannot be closed; empty if they can.
std::string obstacle_to_closing(const Surface& surface, std::optional<double> volume) {
  if (surface.triangle.empty()) return "it has no triangles";
  const Enclosed found = enclosed_by(facets_of(surface.position, surface.triangle, 0, HUGE_VAL));
  // Coordinates of a file may be floats.
  if (!(found.open <= 1e-5)) return "its triangles do not enclose a volume";
  if (!(found.volume > 0)) return "its triangles face inward";
  if (volume && !(std::abs(found.volume / *volume - 1) < 0.3)) {
    return fmt::format("that encloses {:.4g} m^3, and its phyxels have {:.4g}", found.volume,
                       *volume);
  }
  return {};
}

}  // namespace

bool encloses_volume(const Surface& surface) {
  return obstacle_to_closing(surface, std::nullopt).empty();
}

bool may_close(const BodyRequest& request) {
  if (request.closure) return *request.closure > 0;
  const ShapeRequest& shape = request.source.shape;
  const bool regular = !shape.name.empty() && !(shape.jitter > 0) &&
                       shape.placement != ShapeRequest::Placement::fitted;
  return !regular && request.volume_rule != VolumeRule::kernel &&
         !request.neighbourhood.one_sided();
}

bool may_close(const BodyRequest& request, const Surface& surface, bool lattice,
               bool kernel_volumes) {
  if (!may_close(request)) return false;
  return request.closure || (!lattice && !kernel_volumes && !surface.triangle.empty());
}

double closure_of(const BodyRequest& request, const Surface& surface, bool lattice, Index size,
                  std::optional<double> volume, std::vector<std::string>& warnings) {
  if (!may_close(request, surface, lattice, !volume)) return 0;
  std::string obstacle = obstacle_to_closing(surface, volume);
  // Fewer span no space, in which a stress could be uniform.
  if (obstacle.empty() && size < 4) obstacle = fmt::format("it has {} phyxels", size);
  if (obstacle.empty()) return request.closure.value_or(automatic_closure);
  if (!request.closure) {
    warnings.push_back(
        fmt::format("body \"{}\": gradients are not closed, as {}: stresses may be off by some 10%",
                    request.name, obstacle));
    return 0;
  }
  throw InputError(fmt::format(
      "{}: body \"{}\" has closed gradients (closure = {:g}), which need its whole surface, but "
      "{}; "
      "allowed are a mesh, a shape with surfels, or a file with such a surface, of four phyxels or "
      "more, or closure = 0",
      request.where, request.name, *request.closure, obstacle));
}

}  // namespace phyxel
