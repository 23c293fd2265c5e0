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
/// about eight points, and the children of node k are 2k + 1 and 2k + 2.
class PointTree {
 public:
  explicit PointTree(std::span<const Vec3d> point);

  /// The points' indices in the order of the tree, in which nodes are ranges.
  const std::vector<Index>& order() const { return order_; }
  std::size_t nodes() const { return order_.empty() ? 0 : 2 * leaves_ - 1; }
  const Box& box(std::size_t node) const { return box_[node]; }

  /// A summary of the points of each node, shape [nodes].
  /// @param of_point of_point(k) is the summary of point `order()[k]`
  /// @param both both(a, b) is the summary of the points that a and b are summaries of
  template <class OfPoint, class Both>
  auto summaries(OfPoint&& of_point, Both&& both) const {
    std::vector<decltype(of_point(std::size_t{0}))> summary(nodes());
    if (summary.empty()) return summary;
#pragma omp parallel for schedule(static)
    for (std::size_t leaf = leaves_ - 1; leaf < summary.size(); ++leaf) {
      std::size_t k = first_of(leaf);
      const std::size_t end = first_of(leaf + 1);
      summary[leaf] = of_point(k);
      while (++k < end) summary[leaf] = both(summary[leaf], of_point(k));
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
        for (std::size_t k = first_of(node), end = first_of(node + 1); k < end; ++k) visit(k);
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
  /// The first point of a leaf, which is also the end of the leaf before.
  std::size_t first_of(std::size_t leaf) const {
    return order_.size() * (leaf - (leaves_ - 1)) / leaves_;
  }

  std::vector<Index> order_;
  std::vector<Box> box_;
  std::size_t leaves_ = 1;  ///< A power of two, no larger than the number of points.
};

/// The box around two boxes.
Box box_of(const Box& a, const Box& b);

/// The square of the distance from a place to a box [m²]; no larger than that of any point in it,
/// rounding included.
inline double distance2(Vec3d place, const Box& box) {
  const auto gap = [](double at, double low, double high) {
    return at > high ? at - high : at < low ? at - low : 0;
  };
  const Vec3d apart{gap(place.x, box.low.x, box.high.x), gap(place.y, box.low.y, box.high.y),
                    gap(place.z, box.low.z, box.high.z)};
  return dot(apart, apart);
}

}  // namespace phyxel
