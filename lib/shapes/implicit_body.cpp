#include "shapes/implicit_body.hpp"

#include <algorithm>
#include <cmath>

namespace phyxel {
namespace {

/// Smooth minimum: a quadratic where |a - b| < blend.
double smooth_min(double a, double b, double blend) {
  const double near = std::max(blend - std::abs(a - b), 0.0);
  return std::min(a, b) - (blend > 0 ? 0.25 * near * near / blend : 0);
}

}  // namespace

double ImplicitBody::Part::distance(Vec3d p) const {
  const Vec3d d = p - at;
  if (limb) {
    // The nearest ball of the limb has its centre where d(distance)/dt = 0.
    const double x = dot(d, along);
    const double across = norm(d - x * along);
    const double t = std::clamp(x - slope * across / std::sqrt(1 - slope * slope), 0.0, length);
    return std::hypot(x - t, across) - (radius - slope * t);
  }
  const Vec3d scaled{(along.x * d.x + along.z * d.z) * inverse_radii.x, d.y * inverse_radii.y,
                     (along.x * d.z - along.z * d.x) * inverse_radii.z};
  const Vec3d twice{scaled.x * inverse_radii.x, scaled.y * inverse_radii.y,
                    scaled.z * inverse_radii.z};
  // First order in the distance near the surface: (k - 1) over its gradient, k = |scaled|.
  const double k = norm(scaled), gradient = norm(twice);
  if (!(gradient > 0)) {
    return -1 / std::max({inverse_radii.x, inverse_radii.y, inverse_radii.z});
  }
  return k * (k - 1) / gradient;
}

bool ImplicitBody::Part::farther(Vec3d p, double reach) const {
  const Vec3d d = p - ball;
  const double safe = ball_radius + stretch * std::max(reach, 0.0);
  return dot(d, d) > safe * safe;
}

double ImplicitBody::value(Vec3d p) const {
  double value = 1e3;  // [m], far outside
  for (const Part& part : parts_) {
    if (part.farther(p, (part.removes ? -value : value) + part.blend)) continue;
    const double d = part.distance(p);
    value = part.removes ? -smooth_min(-value, d, part.blend) : smooth_min(value, d, part.blend);
  }
  return value;
}

SurfacePoint ImplicitBody::project(Vec3d p) const {
  // Value and gradient from differences over the four corners of a tetrahedron.
  constexpr double step = 1e-5;  // m; errors of 1e-10 m at curvatures of 1/m
  Vec3d gradient;
  for (int iteration = 0; iteration < 3; ++iteration) {
    const double a = value(p + Vec3d{step, -step, -step});
    const double b = value(p + Vec3d{-step, -step, step});
    const double c = value(p + Vec3d{-step, step, -step});
    const double d = value(p + Vec3d{step, step, step});
    gradient = Vec3d{a - b - c + d, -a - b + c + d, -a + b - c + d} / (4 * step);
    const double slope2 = dot(gradient, gradient);
    if (!(slope2 > 1e-4)) break;
    const double here = 0.25 * (a + b + c + d);
    p = p - (here / slope2) * gradient;
    if (std::abs(here) < 1e-6) break;
  }
  return {p, normalised(gradient)};
}

ImplicitBody::Limb ImplicitBody::mirrored(Limb limb) {
  limb.from.y = -limb.from.y;
  limb.to.y = -limb.to.y;
  return limb;
}

ImplicitBody::Ellipsoid ImplicitBody::mirrored(Ellipsoid ellipsoid) {
  ellipsoid.centre.y = -ellipsoid.centre.y;
  return ellipsoid;
}

void ImplicitBody::append(Part part, bool removes, double blend, Vec3d low, Vec3d high) {
  part.removes = removes;
  part.blend = blend;
  parts_.push_back(part);
  if (removes) return;
  const Vec3d seam{blend, blend,
                   blend};  // more than the bulge, at most a quarter of the seam width
  low = low - seam;
  high = high + seam;
  low_ = {std::min(low_.x, low.x), std::min(low_.y, low.y), std::min(low_.z, low.z)};
  high_ = {std::max(high_.x, high.x), std::max(high_.y, high.y), std::max(high_.z, high.z)};
}

void ImplicitBody::append(const Limb& limb, bool removes, double blend) {
  const Vec3d axis = limb.to - limb.from;
  Part part{};
  part.limb = true;
  part.at = limb.from;
  part.along = normalised(axis);
  part.length = norm(axis);
  part.radius = limb.from_radius;
  part.slope = part.length > 0 ? (limb.from_radius - limb.to_radius) / part.length : 0;
  const double r = std::max(limb.from_radius, limb.to_radius);
  part.ball = 0.5 * (limb.from + limb.to);
  part.ball_radius = 0.5 * part.length + r;
  part.stretch = 1;
  const Vec3d a = limb.from, b = limb.to;
  append(part, removes, blend,
         {std::min(a.x, b.x) - r, std::min(a.y, b.y) - r, std::min(a.z, b.z) - r},
         {std::max(a.x, b.x) + r, std::max(a.y, b.y) + r, std::max(a.z, b.z) + r});
}

void ImplicitBody::append(const Ellipsoid& e, bool removes, double blend) {
  Part part{};
  part.at = e.centre;
  part.along = {std::cos(e.pitch), 0, std::sin(e.pitch)};
  part.inverse_radii = {1 / e.radii.x, 1 / e.radii.y, 1 / e.radii.z};
  const double r = std::max({e.radii.x, e.radii.y, e.radii.z});
  part.ball = e.centre;
  part.ball_radius = r;
  // With k >= |d| / r and gradient <= k / (smallest radius), distance >= (|d| - r) / stretch.
  part.stretch = r / std::min({e.radii.x, e.radii.y, e.radii.z});
  append(part, removes, blend, e.centre - Vec3d{r, r, r}, e.centre + Vec3d{r, r, r});
}

void ImplicitBody::add(const Limb& limb, double blend) { append(limb, false, blend); }
void ImplicitBody::add(const Ellipsoid& ellipsoid, double blend) {
  append(ellipsoid, false, blend);
}
void ImplicitBody::cut(const Limb& limb, double blend) { append(limb, true, blend); }
void ImplicitBody::cut(const Ellipsoid& ellipsoid, double blend) { append(ellipsoid, true, blend); }

}  // namespace phyxel
