/// A tree of boxes around points, for searches that boxes and summaries of their points cut short.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "model/box.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// A balanced binary tree over points in the order of a space-filling curve: the leaves are runs of
/// points, and the children of node k are 2k + 1 and 2k + 2.
class PointTree {
 public:
  /// @param most largest number of points in a leaf; some leaves have half as many
  explicit PointTree(std::span<const Vec3d> point, std::size_t most = 8);

  /// The points' indices in the order of the tree, in which nodes are ranges.
  const std::vector<Index>& order() const { return order_; }
  /// Number of nodes; node 0 is the root.
  std::size_t nodes() const { return order_.empty() ? 0 : 2 * leaves_ - 1; }
  /// The box around the points of a node.
  const Box& box(std::size_t node) const { return box_[node]; }
  /// Number of leaves, which are numbered along the order.
  std::size_t leaves() const { return order_.empty() ? 0 : leaves_; }
  /// The node that is a leaf.
  std::size_t node_of(std::size_t leaf) const { return leaves_ - 1 + leaf; }
  /// The first point of a leaf, which is also the end of the leaf before.
  std::size_t first_of(std::size_t leaf) const { return order_.size() * leaf / leaves_; }

  /// Makes the boxes those of the points' new places; the order stays.
  void move_to(std::span<const Vec3d> point);

  /// A summary of the points of each node, shape [nodes].
  /// @param of_point of_point(k) is the summary of point `order()[k]`
  /// @param both both(a, b) is the summary of the points that a and b are summaries of
  template <class OfPoint, class Both>
  auto summaries(OfPoint&& of_point, Both&& both) const {
    std::vector<decltype(of_point(std::size_t{0}))> summary(nodes());
    if (summary.empty()) return summary;
#pragma omp parallel for schedule(static)
    for (std::size_t leaf = 0; leaf < leaves_; ++leaf) {
      auto all = of_point(first_of(leaf));
      for (std::size_t k = first_of(leaf) + 1; k < first_of(leaf + 1); ++k) {
        all = both(all, of_point(k));
      }
      summary[node_of(leaf)] = all;
    }
    for (std::size_t node = leaves_ - 1; node-- > 0;) {
      summary[node] = both(summary[2 * node + 1], summary[2 * node + 2]);
    }
    return summary;
  }

  /// Calls visit(k) for the points `order()[k]` of all leaves but those in nodes whose points all
  /// have values above a limit. It visits nodes with small values first.
  /// @param least_of least_of(node) is at most the value of each of its points
  /// @param limit the limit, which a visit may make smaller
  template <class LeastOf, class Visit>
  void search(LeastOf&& least_of, const double& limit, Visit&& visit) const {
    if (order_.empty()) return;
    std::array<std::pair<std::size_t, double>, 64> waiting;
    int depth = 0;
    waiting[depth++] = {0, least_of(std::size_t{0})};
    while (depth > 0) {
      const auto [node, least] = waiting[--depth];
      if (least > limit) continue;
      if (node >= leaves_ - 1) {
        const std::size_t leaf = node - (leaves_ - 1), end = first_of(leaf + 1);
        for (std::size_t k = first_of(leaf); k < end; ++k) visit(k);
        continue;
      }
      std::size_t near = 2 * node + 1, far = near + 1;
      double least_near = least_of(near), least_far = least_of(far);
      if (least_far < least_near) {
        std::swap(near, far);
        std::swap(least_near, least_far);
      }
      if (least_far <= limit) waiting[depth++] = {far, least_far};
      if (least_near <= limit) waiting[depth++] = {near, least_near};
    }
  }

 private:
  std::vector<Index> order_;
  std::vector<Box> box_;
  std::size_t leaves_ = 1;  ///< A power of two, no larger than the number of points.
};

/// The box around two boxes.
Box box_of(const Box& a, const Box& b);

/// The square of the distance between two boxes [m²]; no larger than that of any two points in
/// them, rounding included.
inline double distance2(const Box& a, const Box& b) {
  const auto gap = [](double low_a, double high_a, double low_b, double high_b) {
    return low_a > high_b ? low_a - high_b : high_a < low_b ? low_b - high_a : 0;
  };
  const Vec3d apart{gap(a.low.x, a.high.x, b.low.x, b.high.x),
                    gap(a.low.y, a.high.y, b.low.y, b.high.y),
                    gap(a.low.z, a.high.z, b.low.z, b.high.z)};
  return dot(apart, apart);
}
/// The same for a place and a box.
inline double distance2(Vec3d place, const Box& box) { return distance2(Box{place, place}, box); }

}  // namespace phyxel
