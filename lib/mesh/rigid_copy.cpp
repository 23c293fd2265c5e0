#include "mesh/rigid_copy.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "model/box.hpp"

namespace phyxel {
namespace {

// Units in the last place of the largest coordinate: a vertex is scaled, turned and moved.
constexpr double rounding = 64 * std::numeric_limits<double>::epsilon();

/// True if a motion takes all vertices of a surface to those of another one.
bool leads(const Surface& from, const Surface& to, const RigidMotion& motion, double tolerance) {
  for (std::size_t v = 0; v < from.position.size(); ++v) {
    const Vec3d apart = motion.turn * from.position[v] + motion.place - to.position[v];
    if (!(norm(apart) <= tolerance)) return false;
  }
  return true;
}

Vec3d mean_of(const std::vector<Vec3d>& points) {
  Vec3d sum;
  for (const Vec3d& x : points) sum += x;
  return sum / static_cast<double>(points.size());
}

/// The motion that takes the vertices of a surface as near as possible to those of another one.
/// Source: Kabsch 1976.
RigidMotion nearest_motion(const Surface& from, const Surface& to) {
  const Vec3d before = mean_of(from.position), after = mean_of(to.position);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t v = 0; v < from.position.size(); ++v) {
    const Vec3d a = from.position[v] - before, b = to.position[v] - after;
    sum += Eigen::Vector3d(b.x, b.y, b.z) * Eigen::RowVector3d(a.x, a.y, a.z);
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double hand = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Matrix3d turn = svd.matrixU() *
                               Eigen::Vector3d(1, 1, hand < 0 ? -1 : 1).asDiagonal() *
                               svd.matrixV().transpose();
  RigidMotion motion;
  for (int e = 0; e < 9; ++e) motion.turn(e / 3, e % 3) = turn(e / 3, e % 3);
  motion.place = after - motion.turn * before;
  return motion;
}

}  // namespace

std::optional<RigidMotion> rigid_motion_between(const Surface& from, const Surface& to) {
  if (from.position.empty() || from.position.size() != to.position.size() ||
      from.triangle != to.triangle) {
    return std::nullopt;
  }
  const double tolerance =
      rounding * std::max(box_around(from.position).farthest(), box_around(to.position).farthest());
  RigidMotion motion{.place = to.position[0] - from.position[0]};
  if (leads(from, to, motion, tolerance)) return motion;
  // Rotations keep the distances of vertices from the first one; the last one is a quick test.
  const double apart = norm(from.position.back() - from.position[0]);
  if (std::abs(norm(to.position.back() - to.position[0]) - apart) > 4 * tolerance) {
    return std::nullopt;
  }
  motion = nearest_motion(from, to);
  if (leads(from, to, motion, tolerance)) return motion;
  return std::nullopt;
}

}  // namespace phyxel
