/// How often a surface winds around a point: 1 inside, 0 outside, in between near holes.
#pragma once

#include <span>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// The generalised winding number by summing the solid angles of all triangles.
/// Source: Jacobson, Kavan, Sorkine-Hornung 2013, eq. (5) and (6); the solid angle of a triangle
/// is that of van Oosterom and Strackee 1983.
double direct_winding_number(const std::vector<Vec3d>& position,
                             const std::vector<Triangle>& triangle, Vec3d point);

/// The same in logarithmic time: far groups of triangles count through the first two terms of
/// their expansion. Source: Barill, Dickson, Schmidt, Levin, Jacobson 2018, section 4.
class WindingNumber {
 public:
  /// A group is far when its distance is more than `accuracy` times its radius. With 2.5 the
  /// largest error seen was below 0.05 (see the test), a tenth of what a point would need to change
  /// sides of a closed surface; the error falls with the square of the accuracy.
  explicit WindingNumber(const Surface& surface, double accuracy = 2.5);

  /// @param work if given, is raised by one for each group and by `angle_work` for each triangle
  ///   that had to be looked at
  double operator()(Vec3d point, Offset* work = nullptr) const;
  static constexpr Offset angle_work = 8;  ///< A solid angle's time, in expansions of groups.

 private:
  struct Corners {
    Vec3d a, b, c;
  };
  /// A box of triangles. Children are adjacent; a leaf has none.
  struct Node {
    Vec3d centre;  ///< Area-weighted [m].
    double radius =
        0;         ///< Of a ball about the centre that holds the triangles, times accuracy [m].
    Vec3d area;    ///< Sum of the triangles' area vectors [m^2].
    Mat3d moment;  ///< Sum of (centroid - centre) (area vector)^T [m^3].
    Index first = 0, count = 0;  ///< Triangles.
    Index child = -1;            ///< The first of two.
  };

  void build(Index node);

  double accuracy_;
  std::vector<Corners> corners_;
  std::vector<Node> nodes_;
};

}  // namespace phyxel
