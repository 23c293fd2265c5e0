#include "mesh/surface_points.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/random_bits.hpp"

namespace phyxel {
namespace {

/// A triangle, or a part of one.
struct Patch {
  std::size_t triangle;
  Vec3d a, b, c;    ///< Corners [m].
  double size = 0;  ///< Its area, by that of one point.
};

/// Adds a triangle in parts that are no longer than the spacing there.
void add_in_parts(const Patch& whole, const SpacingField& spacing, double on_square,
                  std::vector<Patch>& parts) {
  const Vec3d corner[3] = {whole.a, whole.b, whole.c};
  int longest = 0;
  for (int k = 1; k < 3; ++k) {
    const auto side = [&](int of) { return norm(corner[(of + 1) % 3] - corner[of]); };
    if (side(k) > side(longest)) longest = k;
  }
  const Vec3d a = corner[longest], b = corner[(longest + 1) % 3], c = corner[(longest + 2) % 3];
  const double here = spacing.at((a + b + c) / 3.0);
  if (norm(b - a) > 2 * here) {
    const Vec3d middle = 0.5 * (a + b);
    add_in_parts({whole.triangle, a, middle, c}, spacing, on_square, parts);
    add_in_parts({whole.triangle, middle, b, c}, spacing, on_square, parts);
    return;
  }
  Patch part = whole;
  part.size = 0.5 * norm(cross(b - a, c - a)) * on_square / (here * here);
  parts.push_back(part);
}

/// Spreads points over patches. @param patch_of patch_of(k) returns a patch of which `size` is set
/// @param one the size for which a patch gets one point
template <class PatchOf>
Bulk<PointOn> spread_over(std::size_t patches, double one, std::uint64_t seed, PatchOf&& patch_of) {
  constexpr double step_1 = 0.7548776662466927, step_2 = 0.5698402909980532;
  std::vector<std::size_t> first(patches + 1, 0);  // point of each patch
  Shares shares(one);
  for (std::size_t k = 0; k < patches; ++k) {
    first[k + 1] = first[k] + static_cast<std::size_t>(shares.next(patch_of(k).size));
  }
  Bulk<PointOn> points(first.back());
  // A cube has twelve triangles, a scan ten million.
  const std::size_t at_once = patches / 4096 + 1;
#pragma omp parallel for schedule(dynamic, at_once)
  for (std::size_t k = 0; k < patches; ++k) {
    const Patch patch = patch_of(k);
    const Vec3d a = patch.a, ab = patch.b - a, ac = patch.c - a;
    const std::uint64_t bits = mix_bits(seed ^ mix_bits(k));
    double u = unit_fraction(bits), v = unit_fraction(bits >> 21);
    for (std::size_t at = first[k]; at < first[k + 1]; ++at) {
      u += step_1, v += step_2;
      u -= std::floor(u), v -= std::floor(v);
      points[at] = {patch.triangle,
                    u + v < 1 ? a + u * ab + v * ac : a + (1 - u) * ab + (1 - v) * ac};
    }
  }
  return points;
}

}  // namespace

Vec3d area_of(const Surface& surface, Index triangle) {
  const Triangle& t = surface.triangle[triangle];
  const Vec3d a = surface.position[t[0]];
  return 0.5 * cross(surface.position[t[1]] - a, surface.position[t[2]] - a);
}

Bulk<PointOn> points_over(const Surface& surface, const SpacingField& spacing, double on_square,
                          std::uint64_t seed) {
  const auto triangle = [&](std::size_t t) {
    const Triangle& corner = surface.triangle[t];
    return Patch{t, surface.position[corner[0]], surface.position[corner[1]],
                 surface.position[corner[2]], 0};
  };
  const std::size_t triangles = surface.triangle.size();
  if (spacing.is_uniform()) {
    const double s = spacing.coarsest();
    return spread_over(triangles, s * s / on_square, seed, [&](std::size_t t) {
      Patch patch = triangle(t);
      patch.size = norm(area_of(surface, static_cast<Index>(t)));
      return patch;
    });
  }
  std::vector<Patch> parts;
  for (std::size_t t = 0; t < triangles; ++t) {
    add_in_parts(triangle(t), spacing, on_square, parts);
  }
  return spread_over(parts.size(), 1, seed, [&](std::size_t k) { return parts[k]; });
}

}  // namespace phyxel
