#include <algorithm>

#include "mesh/mesh_formats.hpp"

namespace phyxel {
namespace {

struct Point2 {
  double x, y;
};

/// Twice the signed area of a triangle in the plane.
double twice_area(Point2 a, Point2 b, Point2 c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

bool inside(Point2 p, Point2 a, Point2 b, Point2 c) {
  return twice_area(a, b, p) >= 0 && twice_area(b, c, p) >= 0 && twice_area(c, a, p) >= 0;
}

}  // namespace

void append_polygon(std::span<const Index> corners, const std::vector<Vec3d>& position,
                    std::vector<Triangle>& triangle) {
  if (corners.size() == 3) {
    triangle.push_back({corners[0], corners[1], corners[2]});
    return;
  }
  // Newell's normal; the polygon is projected along its largest component.
  Vec3d normal;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const Vec3d origin = position[corners[0]];
    normal +=
        cross(position[corners[k]] - origin, position[corners[(k + 1) % corners.size()]] - origin);
  }
  const double ax = std::abs(normal.x), ay = std::abs(normal.y), az = std::abs(normal.z);
  const auto flatten = [&](Index corner) -> Point2 {
    const Vec3d p = position[corner];
    if (az >= ax && az >= ay) return normal.z >= 0 ? Point2{p.x, p.y} : Point2{p.y, p.x};
    if (ax >= ay) return normal.x >= 0 ? Point2{p.y, p.z} : Point2{p.z, p.y};
    return normal.y >= 0 ? Point2{p.z, p.x} : Point2{p.x, p.z};
  };
  std::vector<Index> ring(corners.begin(), corners.end());
  std::vector<Point2> flat(ring.size());
  std::transform(ring.begin(), ring.end(), flat.begin(), flatten);

  while (ring.size() > 3) {
    const std::size_t n = ring.size();
    // The ear is the convex corner whose triangle contains no other corner and is the roundest; if
    // rounding leaves none, it is the first corner.
    std::size_t ear = 0;
    double best = -1;
    for (std::size_t k = 0; k < n; ++k) {
      const Point2 a = flat[(k + n - 1) % n], b = flat[k], c = flat[(k + 1) % n];
      const double area = twice_area(a, b, c);
      const double edges = (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) +
                           (b.x - c.x) * (b.x - c.x) + (b.y - c.y) * (b.y - c.y) +
                           (c.x - a.x) * (c.x - a.x) + (c.y - a.y) * (c.y - a.y);
      if (!(area > 0 && area > best * edges)) continue;
      bool empty = true;
      for (std::size_t other = 0; other < n && empty; ++other) {
        if (other == k || other == (k + 1) % n || other == (k + n - 1) % n) continue;
        empty = !inside(flat[other], a, b, c);
      }
      if (!empty) continue;
      ear = k;
      best = area / edges;
      if (n > 64)
        break;  // a quadratic search for the roundest triangle pays in small polygons only
    }
    triangle.push_back({ring[(ear + n - 1) % n], ring[ear], ring[(ear + 1) % n]});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(ear));
    flat.erase(flat.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  triangle.push_back({ring[0], ring[1], ring[2]});
}

}  // namespace phyxel
