/// The winding number of a surface around a point: 1 inside, 0 outside, in between near holes.
#pragma once

#include <span>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// The generalised winding number, as the sum of the solid angles of the triangles.
/// Source: Jacobson, Kavan, Sorkine-Hornung 2013, eq. (5) and (6); the solid angle of a triangle
/// is that of van Oosterom and Strackee 1983.
double direct_winding_number(const std::vector<Vec3d>& position,
                             const std::vector<Triangle>& triangle, Vec3d point);

/// The generalised winding number in logarithmic time: groups of distant triangles are evaluated by
/// the first two terms of their expansion.
/// Source: Barill, Dickson, Schmidt, Levin, Jacobson 2018, section 4.
class WindingNumber {
 public:
  /// @param accuracy a group is distant if its distance is more than `accuracy` radii. The largest
  ///   error seen with 2.5 was below 0.05 (see the test), a tenth of the error that moves a point
  ///   to the other side of a closed surface; it falls with the square of the accuracy.
  explicit WindingNumber(const Surface& surface, double accuracy = 2.5);

  /// @param work if given, is raised by one for each group and by `angle_work` for each triangle
  ///   visited
  double operator()(Vec3d point, Offset* work = nullptr) const;
  /// The distance from a point to the nearest triangle [m], or `most` where it is larger.
  /// @param nearest if given, is a triangle likely to be near, or -1, and receives the nearest one;
  ///   the distance is the same for any
  double distance(Vec3d point, double most, Index* nearest = nullptr) const;
  static constexpr Offset angle_work = 8;  ///< Cost of a solid angle, in expansions of groups.

 private:
  struct Corners {
    Vec3d a, b, c;
  };
  /// The box around the triangles of a node [m].
  struct Bounds {
    Vec3d low, high;
    /// The squared distance of a point, 0 inside [m²].
    double squared_distance(Vec3d x) const;
  };
  /// A node of the tree of triangles. Its two children are adjacent; a leaf has none.
  struct Node {
    Vec3d centre;  ///< Area-weighted [m].
    /// Radius about the centre of a ball that contains the triangles, times `accuracy` [m].
    double radius = 0;
    Vec3d area;                  ///< Sum of the triangles' area vectors [m^2].
    Mat3d moment;                ///< Sum of (centroid - centre) (area vector)^T [m^3].
    Index first = 0, count = 0;  ///< Range of triangles.
    Index child = -1;            ///< First child; -1 for a leaf.
  };

  void build(Index node);

  double accuracy_;
  std::vector<Corners> corners_;
  std::vector<Node> nodes_;
  std::vector<Bounds> bounds_;  // of each node
};

}  // namespace phyxel
