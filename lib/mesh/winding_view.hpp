/// The winding number of a surface, and distances from it, by a tree of its triangles that lies on
/// the host or on a device.
#pragma once

#include <cmath>
#include <cstdint>

#include "mesh/triangle.hpp"

namespace phyxel {

/// Half the solid angle of the triangle (a, b, c) seen from the origin. On the triangle's plane
/// the sign is undecided; seen from its own corner the angle counts as zero.
PHYXEL_HD double half_solid_angle(Vec3d a, Vec3d b, Vec3d c) {
  using std::atan2, std::sqrt;
  const double la = sqrt(dot(a, a)), lb = sqrt(dot(b, b)), lc = sqrt(dot(c, c));
  const double numerator = dot(a, cross(b, c));
  const double denominator = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
  return numerator == 0 ? 0 : atan2(numerator, denominator);
}

/// A node of a tree of triangles. Its two children are adjacent; a leaf has none.
struct WindingNode {
  Vec3d centre;  ///< Area-weighted [m].
  /// Radius about the centre of a ball that contains the triangles, times the accuracy [m].
  double radius = 0;
  Vec3d area;                  ///< Sum of the triangles' area vectors [m^2].
  Mat3d moment;                ///< Sum of (centroid - centre) (area vector)^T [m^3].
  Index first = 0, count = 0;  ///< Range of triangles.
  Index child = -1;            ///< First child; -1 for a leaf.
};

/// The box around the triangles of a node [m].
struct TriangleBox {
  Vec3d low, high;

  /// The squared distance of a point, 0 inside [m²].
  PHYXEL_HD double squared_distance(Vec3d x) const {
    const Vec3d way{beyond(x.x, low.x, high.x), beyond(x.y, low.y, high.y),
                    beyond(x.z, low.z, high.z)};
    return dot(way, way);
  }

 private:
  PHYXEL_HD static double beyond(double at, double least, double most) {
    const double below = least - at, above = at - most, larger = below > above ? below : above;
    return larger > 0 ? larger : 0;
  }
};

/// A tree of triangles; see `WindingNumber`.
struct WindingView {
  static constexpr Offset angle_work = 8;  ///< Cost of a solid angle, in expansions of groups.
  static constexpr double pi = 3.14159265358979323846;

  const Corners* corners;
  const WindingNode* nodes;
  const TriangleBox* boxes;  ///< Of the nodes.

  /// The winding number of a point. @param work is raised by the work done
  PHYXEL_HD double winding(Vec3d point, Offset& work) const {
    using std::sqrt;
    double near = 0, far = 0;  // in units of half solid angles and of solid angles
    Index stack[64];
    int depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const WindingNode& node = nodes[stack[--depth]];
      ++work;
      const Vec3d r = node.centre - point;
      const double r2 = dot(r, r);
      if (r2 > node.radius * node.radius) {
        // With G(r) = r / |r|^3: area . G + moment : grad G.
        const double inverse2 = 1 / r2, inverse3 = inverse2 / sqrt(r2);
        const Mat3d& m = node.moment;
        far += inverse3 *
               (dot(node.area, r) + m(0, 0) + m(1, 1) + m(2, 2) - 3 * inverse2 * dot(r, m * r));
      } else if (node.child >= 0) {
        stack[depth++] = node.child + 1;
        stack[depth++] = node.child;
      } else {
        work += angle_work * node.count;
        for (Index t = node.first; t < node.first + node.count; ++t) {
          const Corners& c = corners[t];
          near += half_solid_angle(c.a - point, c.b - point, c.c - point);
        }
      }
    }
    return near / (2 * pi) + far / (4 * pi);
  }

  /// The distance from a point to the nearest triangle [m], or `most` where it is larger.
  /// @param at a triangle likely to be near, or -1; receives the nearest one
  PHYXEL_HD double distance(Vec3d point, double most, Index& at) const {
    double nearest = most;
    if (at >= 0) look(point, at, nearest, at);
    Waiting stack[64];
    int depth = 0;
    stack[depth++] = waiting(point, 0);
    while (depth > 0) {
      const Waiting next = stack[--depth];
      if (next.least >= nearest * nearest) continue;
      const WindingNode& node = nodes[next.node];
      if (node.child >= 0) {
        const Waiting one = waiting(point, node.child), other = waiting(point, node.child + 1);
        const bool other_first = other.least < one.least;
        stack[depth++] = other_first ? one : other;
        stack[depth++] = other_first ? other : one;
        continue;
      }
      for (Index t = node.first; t < node.first + node.count; ++t) look(point, t, nearest, at);
    }
    return nearest;
  }

 private:
  /// A node to visit, and the least squared distance of its triangles.
  struct Waiting {
    Index node;
    double least;
  };

  PHYXEL_HD Waiting waiting(Vec3d point, Index node) const {
    return {node, boxes[node].squared_distance(point)};
  }
  PHYXEL_HD void look(Vec3d point, Index t, double& nearest, Index& at) const {
    using std::sqrt;
    const Corners& c = corners[t];
    const Vec3d apart = nearest_on_triangle(point, c.a, c.b, c.c) - point;
    const double found = sqrt(dot(apart, apart));
    if (!(found < nearest)) return;
    nearest = found;
    at = t;
  }
};

/// A ball inside a surface that no triangle reaches.
struct ClearBall {
  Vec3d middle;       ///< [m]
  double radius = 0;  ///< [m]
};

/// True if a point inside a closed surface is inside after a step, too. Steps within a ball need
/// no winding number.
/// @param ball a ball around a former place of the same point; replaced once the point leaves it
/// @param most radius of the largest balls [m]
/// @param is_inside is_inside(place) tells whether a place is inside
template <class IsInside>
PHYXEL_HD bool stays_inside(const WindingView& tree, Vec3d before, Vec3d after, double most,
                            ClearBall& ball, IsInside&& is_inside) {
  using std::sqrt;
  constexpr double rounding = 1e-6;
  const auto holds = [&] {
    const Vec3d apart = after - ball.middle;
    return sqrt(dot(apart, apart)) < (1 - rounding) * ball.radius;
  };
  if (holds()) return true;
  Index nearest = -1;
  ball = {before, tree.distance(before, most, nearest)};
  return holds() || is_inside(after);
}

}  // namespace phyxel
