#include "model/region_integrals.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "model/box.hpp"

namespace phyxel {
namespace {

/// ∫ dV and ∫ x dV over the piece.
struct Integrals {
  double volume = 0;
  Vec3d moment;
};

using Polygon = std::vector<Vec3d>;

/// The part of a polygon where sign * (component `axis` - limit) <= 0. A polygon that lies in the
/// plane belongs to the part with sign > 0 only.
Polygon clipped(const Polygon& polygon, int axis, double limit, double sign) {
  Polygon kept;
  const auto beyond = [&](Vec3d p) { return sign * (component(p, axis) - limit); };
  if (sign < 0 &&
      std::all_of(polygon.begin(), polygon.end(), [&](Vec3d p) { return beyond(p) == 0; })) {
    return kept;
  }
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Vec3d a = polygon[k], b = polygon[(k + 1) % polygon.size()];
    const double da = beyond(a), db = beyond(b);
    if (da <= 0) kept.push_back(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) kept.push_back(a + (da / (da - db)) * (b - a));
  }
  return kept;
}

/// Adds the integrals over a triangle of a field whose x component is
///   X(x) = x limited to [low.x, high.x],
/// and whose divergence in the slab of the box is 1 inside the box and 0 elsewhere. Products of X
/// and linear functions are quadratic on each triangle: three points integrate them exactly.
void add_slab_triangle(Integrals& sums, Vec3d a, Vec3d b, Vec3d c, double low, double high) {
  const double area_x = 0.5 * cross(b - a, c - a).x;
  for (const Vec3d p : {0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)}) {
    const double x = std::clamp(p.x, low, high), share = area_x / 3;
    sums.volume += share * x;
    sums.moment += share * Vec3d{0.5 * x * x, x * p.y, x * p.z};
  }
}

Integrals in_box(const Surface& surface, Vec3d origin, Vec3d low, Vec3d high) {
  Integrals sums;
  for (const Triangle& t : surface.triangle) {
    Polygon slab;
    for (const Index corner : t) slab.push_back(surface.position[corner] - origin);
    for (const int axis : {1, 2}) {
      slab = clipped(slab, axis, component(low, axis), -1);
      slab = clipped(slab, axis, component(high, axis), 1);
    }
    // X is linear on each of the parts below, inside and above the box.
    for (const Polygon& part :
         {clipped(slab, 0, low.x, 1), clipped(clipped(slab, 0, low.x, -1), 0, high.x, 1),
          clipped(slab, 0, high.x, -1)}) {
      for (std::size_t k = 2; k < part.size(); ++k) {
        add_slab_triangle(sums, part[0], part[k - 1], part[k], low.x, high.x);
      }
    }
  }
  return sums;
}

/// Adds the integrals over a triangle of p g(r), the position from the ball's centre times a
/// function with the divergence 1 inside the ball and 0 outside; for moments, times a coordinate.
/// @param finest sides of triangles on the sphere [m]
void add_ball_triangle(Integrals& sums, Vec3d a, Vec3d b, Vec3d c, double radius, double finest) {
  const double longest = std::max({norm(b - a), norm(c - b), norm(a - c)});
  const double nearest = norm((a + b + c) / 3.0) - 0.6 * longest,
               farthest = std::max({norm(a), norm(b), norm(c)});
  const bool inside = farthest <= radius;
  // The function has a kink on the sphere, and is the smoother the farther it is outside.
  if (!inside && longest > (nearest > radius ? 0.25 * nearest : finest)) {
    const Vec3d ab = 0.5 * (a + b), bc = 0.5 * (b + c), ca = 0.5 * (c + a);
    add_ball_triangle(sums, a, ab, ca, radius, finest);
    add_ball_triangle(sums, ab, b, bc, radius, finest);
    add_ball_triangle(sums, ca, bc, c, radius, finest);
    add_ball_triangle(sums, ab, bc, ca, radius, finest);
    return;
  }
  const Vec3d area = 0.5 * cross(b - a, c - a);
  const double height = dot(a, area);  // of the triangle's plane, times its area
  for (const Vec3d p : {0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)}) {
    const double ratio = std::min(radius / norm(p), 1.0);
    sums.volume += height / 9 * std::pow(ratio, 3);
    sums.moment += (height / 12 * std::pow(ratio, 4)) * p;
  }
}

}  // namespace

BodyPiece piece_in(const Surface& surface, const SpaceRegion& region) {
  const auto [low, high] = box_around(surface.position);
  const Vec3d origin = region.is_ball ? region.centre : 0.5 * (low + high);
  Integrals sums;
  if (region.is_ball) {
    const double finest = std::min(region.radius, norm(high - low)) / 40;
    for (const Triangle& t : surface.triangle) {
      add_ball_triangle(sums, surface.position[t[0]] - origin, surface.position[t[1]] - origin,
                        surface.position[t[2]] - origin, region.radius, finest);
    }
  } else {
    sums = in_box(surface, origin, region.low - origin, region.high - origin);
  }
  BodyPiece piece{sums.volume, origin};
  if (sums.volume > 0) piece.centroid += sums.moment / sums.volume;
  return piece;
}

}  // namespace phyxel
