#include "mesh/thickness.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/point_tree.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Cosine between the outward normals of two faces from which they are two sides of a thin place.
constexpr double opposite = -0.6;
/// Cosine of the angle between the inward normal of a point and the way to another one, from which
/// the other one does not lie beside it.
constexpr double inward = 0.1;

/// The smallest product of a vector with any vector of a box; no larger than that of each of them,
/// rounding included.
double least_dot(Vec3d v, const Box& box) {
  return dot(v, {v.x > 0 ? box.low.x : box.high.x, v.y > 0 ? box.low.y : box.high.y,
                 v.z > 0 ? box.low.z : box.high.z});
}

/// Points on a surface with the normals of their faces, in a tree.
class SurfaceTree {
 public:
  SurfaceTree(std::span<const Vec3d> place, std::span<const Vec3d> normal)
      : tree_(place),
        points_(tabulated(place.size(),
                          [&](std::size_t k) {
                            return Point{place[tree_.order()[k]], normal[tree_.order()[k]]};
                          })),
        normals_(tree_.summaries(
            [&](std::size_t k) {
              return Box{points_[k].normal, points_[k].normal};
            },
            box_of)) {}

  /// The thickness at each point, in their order before.
  std::vector<double> thicknesses(double farthest) const {
    std::vector<double> thickness(points_.size());
#pragma omp parallel for schedule(dynamic, 256)
    for (std::size_t k = 0; k < points_.size(); ++k) {
      thickness[tree_.order()[k]] = thickness_at(points_[k], farthest);
    }
    return thickness;
  }

 private:
  struct Point {
    Vec3d place;   ///< [m]
    Vec3d normal;  ///< Outward.
  };

  double thickness_at(const Point& at, double farthest) const {
    double thickness = HUGE_VAL, nearest2 = farthest * farthest;
    const auto least_distance2 = [&](std::size_t node) {
      if (least_dot(at.normal, normals_[node]) > opposite) return HUGE_VAL;
      const Box& box = tree_.box(node);
      const double apart2 = distance2(at.place, box),
                   most_through = -least_dot(at.normal, {box.low - at.place, box.high - at.place});
      return most_through > inward * std::sqrt(apart2) ? apart2 : HUGE_VAL;
    };
    tree_.search(least_distance2, nearest2, [&](std::size_t k) {
      const Vec3d apart = at.place - points_[k].place;
      const double through = dot(apart, at.normal), apart2 = dot(apart, apart);
      if (apart2 > nearest2 || !(through > inward * std::sqrt(apart2))) return;
      if (dot(at.normal, points_[k].normal) > opposite) return;
      nearest2 = apart2;
      thickness = through;
    });
    return thickness;
  }

  PointTree tree_;
  std::vector<Point> points_;  ///< In the order of the tree.
  std::vector<Box> normals_;   ///< Box around the normals of each node.
};

}  // namespace

std::vector<double> thicknesses(std::span<const Vec3d> place, std::span<const Vec3d> normal,
                                double farthest) {
  return SurfaceTree(place, normal).thicknesses(farthest);
}

}  // namespace phyxel
