#include "mesh/winding_number.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "mesh/face_relaxation.hpp"
#include "model/box.hpp"

namespace phyxel {
namespace {

constexpr Index largest_leaf = 8;

/// Half the solid angle of the triangle (a, b, c) seen from the origin. On the triangle's plane
/// the sign is undecided; seen from its own corner the angle counts as zero.
double half_solid_angle(Vec3d a, Vec3d b, Vec3d c) {
  const double la = norm(a), lb = norm(b), lc = norm(c);
  const double numerator = dot(a, cross(b, c));
  const double denominator = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
  return numerator == 0 ? 0 : std::atan2(numerator, denominator);
}

}  // namespace

double direct_winding_number(const std::vector<Vec3d>& position,
                             const std::vector<Triangle>& triangle, Vec3d point) {
  double sum = 0;
  for (const Triangle& t : triangle) {
    sum += half_solid_angle(position[t[0]] - point, position[t[1]] - point, position[t[2]] - point);
  }
  return sum / (2 * std::numbers::pi);
}

double WindingNumber::Bounds::squared_distance(Vec3d x) const {
  const auto beyond = [](double at, double least, double most) {
    return std::max({least - at, at - most, 0.0});
  };
  const Vec3d way{beyond(x.x, low.x, high.x), beyond(x.y, low.y, high.y),
                  beyond(x.z, low.z, high.z)};
  return dot(way, way);
}

WindingNumber::WindingNumber(const Surface& surface, double accuracy) : accuracy_(accuracy) {
  corners_.reserve(surface.triangle.size());
  for (const Triangle& t : surface.triangle) {
    corners_.push_back({surface.position[t[0]], surface.position[t[1]], surface.position[t[2]]});
  }
  if (corners_.empty()) return;
  nodes_.reserve(corners_.size() / 2 + 8);
  nodes_.emplace_back();
  nodes_[0].count = static_cast<Index>(corners_.size());
  // Children are appended, so the loop reaches every node.
  for (Index node = 0; node < static_cast<Index>(nodes_.size()); ++node) build(node);
}

void WindingNumber::build(Index index) {
  Node node = nodes_[index];
  const auto first = corners_.begin() + node.first, last = first + node.count;

  double total = 0;
  Vec3d low = first->a, high = first->a, sum;
  for (auto t = first; t != last; ++t) {
    const Vec3d area = 0.5 * cross(t->b - t->a, t->c - t->a);
    const Vec3d centroid = (t->a + t->b + t->c) / 3.0;
    const double size = norm(area);
    total += size;
    sum += size * centroid;
    node.area += area;
    if (t == first) low = high = centroid;
    low = {std::min(low.x, centroid.x), std::min(low.y, centroid.y), std::min(low.z, centroid.z)};
    high = {std::max(high.x, centroid.x), std::max(high.y, centroid.y),
            std::max(high.z, centroid.z)};
  }
  node.centre = total > 0 ? sum / total : 0.5 * (low + high);
  for (auto t = first; t != last; ++t) {
    const Vec3d area = 0.5 * cross(t->b - t->a, t->c - t->a);
    node.moment += outer((t->a + t->b + t->c) / 3.0 - node.centre, area);
    node.radius = std::max({node.radius, norm(t->a - node.centre), norm(t->b - node.centre),
                            norm(t->c - node.centre)});
  }
  node.radius *= accuracy_;
  std::vector<Vec3d> points;
  for (auto t = first; t != last; ++t) points.insert(points.end(), {t->a, t->b, t->c});
  const Box box = box_around(points);
  bounds_.push_back({box.low, box.high});  // nodes are built in their order

  if (node.count > largest_leaf) {
    const Vec3d extent = high - low;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0
                     : extent.y >= extent.z                       ? 1
                                                                  : 2;
    const auto along = [axis](const Corners& t) {
      const Vec3d c = t.a + t.b + t.c;
      return axis == 0 ? c.x : axis == 1 ? c.y : c.z;
    };
    const Index half = node.count / 2;
    std::nth_element(first, first + half, last,
                     [&](const Corners& s, const Corners& t) { return along(s) < along(t); });
    node.child = static_cast<Index>(nodes_.size());
    Node left, right;
    left.first = node.first;
    left.count = half;
    right.first = node.first + half;
    right.count = node.count - half;
    nodes_.push_back(left);
    nodes_.push_back(right);
  }
  nodes_[index] = node;
}

double WindingNumber::operator()(Vec3d point, Offset* work) const {
  if (nodes_.empty()) return 0;
  Offset done = 0;
  double near = 0, far = 0;  // in units of half solid angles and of solid angles
  Index stack[64];
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    ++done;
    const Vec3d r = node.centre - point;
    const double r2 = dot(r, r);
    if (r2 > node.radius * node.radius) {
      // With G(r) = r / |r|^3: area . G + moment : grad G.
      const double inverse2 = 1 / r2, inverse3 = inverse2 / std::sqrt(r2);
      const Mat3d& m = node.moment;
      far += inverse3 *
             (dot(node.area, r) + m(0, 0) + m(1, 1) + m(2, 2) - 3 * inverse2 * dot(r, m * r));
    } else if (node.child >= 0) {
      stack[depth++] = node.child + 1;
      stack[depth++] = node.child;
    } else {
      done += angle_work * node.count;
      for (Index t = node.first; t < node.first + node.count; ++t) {
        const Corners& c = corners_[t];
        near += half_solid_angle(c.a - point, c.b - point, c.c - point);
      }
    }
  }
  if (work) *work += done;
  return near / (2 * std::numbers::pi) + far / (4 * std::numbers::pi);
}

double WindingNumber::distance(Vec3d point, double most, Index* nearest_triangle) const {
  if (nodes_.empty()) return most;
  double nearest = most;
  Index unused = -1;
  Index& at = nearest_triangle ? *nearest_triangle : unused;
  const auto look = [&](Index t) {
    const Corners& c = corners_[t];
    const double found = norm(nearest_on_triangle(point, c.a, c.b, c.c) - point);
    if (!(found < nearest)) return;
    nearest = found;
    at = t;
  };
  if (at >= 0) look(at);
  /// A node to visit, and the least squared distance of its triangles.
  struct Waiting {
    Index node;
    double least;
  };
  const auto waiting = [&](Index index) {
    return Waiting{index, bounds_[static_cast<std::size_t>(index)].squared_distance(point)};
  };
  Waiting stack[64];
  int depth = 0;
  stack[depth++] = waiting(0);
  while (depth > 0) {
    const Waiting next = stack[--depth];
    if (next.least >= nearest * nearest) continue;
    const Node& node = nodes_[next.node];
    if (node.child >= 0) {
      Waiting near = waiting(node.child), far = waiting(node.child + 1);
      if (far.least < near.least) std::swap(near, far);
      stack[depth++] = far;
      stack[depth++] = near;
      continue;
    }
    for (Index t = node.first; t < node.first + node.count; ++t) look(t);
  }
  return nearest;
}

}  // namespace phyxel
