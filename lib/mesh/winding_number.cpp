#include "mesh/winding_number.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/box.hpp"

namespace phyxel {
namespace {

constexpr Index largest_leaf = 8;

}  // namespace

double direct_winding_number(const std::vector<Vec3d>& position,
                             const std::vector<Triangle>& triangle, Vec3d point) {
  double sum = 0;
  for (const Triangle& t : triangle) {
    sum += half_solid_angle(position[t[0]] - point, position[t[1]] - point, position[t[2]] - point);
  }
  return sum / (2 * std::numbers::pi);
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
  WindingNode node = nodes_[index];
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
  boxes_.push_back({box.low, box.high});  // nodes are built in their order

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
    WindingNode left, right;
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
  const double found = view().winding(point, done);
  if (work) *work += done;
  return found;
}

double WindingNumber::distance(Vec3d point, double most, Index* nearest) const {
  if (nodes_.empty()) return most;
  Index unused = -1;
  return view().distance(point, most, nearest ? *nearest : unused);
}

}  // namespace phyxel
