/// The winding number of a surface around a point: 1 inside, 0 outside, in between near holes.
#pragma once

#include <span>
#include <vector>

#include "mesh/winding_view.hpp"
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

  /// @param work if given, is raised by one for each group and by `WindingView::angle_work` for
  ///   each triangle visited
  double operator()(Vec3d point, Offset* work = nullptr) const;
  /// The distance from a point to the nearest triangle [m], or `most` where it is larger.
  /// @param nearest if given, is a triangle likely to be near, or -1, and receives the nearest one;
  ///   the distance is the same for any
  double distance(Vec3d point, double most, Index* nearest = nullptr) const;
  /// The tree of the triangles, as long as this lives; it needs one triangle at least.
  WindingView view() const { return {corners_.data(), nodes_.data(), boxes_.data()}; }
  std::span<const Corners> corners() const { return corners_; }
  std::span<const WindingNode> nodes() const { return nodes_; }
  std::span<const TriangleBox> boxes() const { return boxes_; }

 private:
  void build(Index node);

  double accuracy_;
  std::vector<Corners> corners_;
  std::vector<WindingNode> nodes_;
  std::vector<TriangleBox> boxes_;  // of each node
};

}  // namespace phyxel
