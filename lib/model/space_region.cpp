#include "phyxel/space_region.hpp"

#include <algorithm>
#include <tuple>

namespace phyxel {
namespace {

Vec3d along_edges(const SpaceRegion& box, Vec3d v) {
  return {dot(box.edge[0], v), dot(box.edge[1], v), dot(box.edge[2], v)};
}

/// Distances beyond the nearer of two opposite faces of a box, by direction; negative between them.
Vec3d beyond_faces(const SpaceRegion& box, Vec3d p) {
  return {std::max(box.low.x - p.x, p.x - box.high.x), std::max(box.low.y - p.y, p.y - box.high.y),
          std::max(box.low.z - p.z, p.z - box.high.z)};
}

/// The end of a range nearer to a value.
double nearer_end(double value, double low, double high) {
  return value - low < high - value ? low : high;
}

}  // namespace

bool SpaceRegion::contains(Vec3d point) const {
  if (is_ball) return radius >= 0 && dot(point - centre, point - centre) <= radius * radius;
  const Vec3d beyond = beyond_faces(*this, along_edges(*this, point));
  return std::max({beyond.x, beyond.y, beyond.z}) <= 0;
}

double SpaceRegion::distance(Vec3d point) const {
  if (is_ball) return norm(point - centre) - radius;
  const Vec3d beyond = beyond_faces(*this, along_edges(*this, point));
  const double nearest = std::max({beyond.x, beyond.y, beyond.z});
  if (nearest <= 0) return nearest;
  return norm(Vec3d{std::max(beyond.x, 0.0), std::max(beyond.y, 0.0), std::max(beyond.z, 0.0)});
}

SpaceRegion SpaceRegion::shrunk(double by) const {
  SpaceRegion made = *this;
  made.low = low + Vec3d{by, by, by};
  made.high = high - Vec3d{by, by, by};
  made.radius -= by;
  return made;
}

Vec3d SpaceRegion::nearest_on_boundary(Vec3d point, double inset) const {
  if (is_ball) {
    const Vec3d out = point - centre;
    const double length = norm(out);
    const Vec3d direction = length > 0 ? out / length : Vec3d{1, 0, 0};
    return centre + std::max(radius - inset, 0.0) * direction;
  }
  const Vec3d p = along_edges(*this, point), beyond = beyond_faces(*this, p);
  double at[3] = {p.x, p.y, p.z};
  const double past[3] = {beyond.x, beyond.y, beyond.z};
  const double from[3] = {low.x, low.y, low.z}, to[3] = {high.x, high.y, high.z};
  const int face = static_cast<int>(std::max_element(past, past + 3) - past);
  if (past[face] < 0) at[face] = nearer_end(at[face], from[face], to[face]);
  for (int k = 0; k < 3; ++k) {
    const double room = std::min(inset, 0.5 * (to[k] - from[k]));
    at[k] = std::clamp(at[k], from[k] + room, std::max(to[k] - room, from[k] + room));
  }
  return at[0] * edge[0] + at[1] * edge[1] + at[2] * edge[2];
}

SpaceRegion SpaceRegion::before_placement(double scale, const Mat3d& rotation,
                                          Vec3d translation) const {
  const Mat3d back = transpose(rotation);
  SpaceRegion before = *this;
  if (is_ball) {
    before.centre = (back * (centre - translation)) / scale;
    before.radius = radius / scale;
    return before;
  }
  for (Vec3d& e : before.edge) e = back * e;
  const Vec3d shift = along_edges(*this, translation);
  before.low = (low - shift) / scale;
  before.high = (high - shift) / scale;
  return before;
}

SpaceRegion SpaceRegion::placed(double scale, const Mat3d& rotation, Vec3d translation) const {
  SpaceRegion after = *this;
  if (is_ball) {
    after.centre = rotation * (scale * centre) + translation;
    after.radius = scale * radius;
    return after;
  }
  for (Vec3d& e : after.edge) e = rotation * e;
  const Vec3d shift = along_edges(after, translation);
  after.low = scale * low + shift;
  after.high = scale * high + shift;
  return after;
}

SpaceRegion SpaceRegion::scaled(double factor) const {
  SpaceRegion made = *this;
  made.low = factor * low;
  made.high = factor * high;
  made.centre = factor * centre;
  made.radius = factor * radius;
  return made;
}

bool comes_before(const SpaceRegion& a, const SpaceRegion& b) {
  const auto of_vector = [](Vec3d v) { return std::tuple(v.x, v.y, v.z); };
  const auto key = [&](const SpaceRegion& r) {
    return std::tuple(r.is_ball, of_vector(r.low), of_vector(r.high), of_vector(r.centre), r.radius,
                      of_vector(r.edge[0]), of_vector(r.edge[1]), of_vector(r.edge[2]));
  };
  return key(a) < key(b);
}

std::vector<SpaceRegion> regions_of(std::span<const SupportRegion> supports) {
  std::vector<SpaceRegion> regions;
  for (const SupportRegion& support : supports) regions.push_back(support.region);
  return regions;
}

}  // namespace phyxel
