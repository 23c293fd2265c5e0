#include "mesh/cuts.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numbers>

namespace phyxel {
namespace {

/// A point with its distance from a region's boundary [m].
struct Measured {
  Vec3d point;
  double distance;
  bool inside() const { return distance <= 0; }
};

Measured measured(const SpaceRegion& region, Vec3d p) { return {p, region.distance(p)}; }

/// The place between two points on different sides of a region's boundary where it is crossed.
Vec3d crossing(const SpaceRegion& region, Measured a, Measured b) {
  // Distances from a plane are linear, and the first step finds the place; others are halved.
  for (int k = 0; k < 40; ++k) {
    const double share = a.distance / (a.distance - b.distance);
    const double at = std::isfinite(share) ? std::clamp(share, 0.05, 0.95) : 0.5;
    const Measured found = measured(
        region, a.point + (k == 0 && std::isfinite(share) ? share : at) * (b.point - a.point));
    if (std::abs(found.distance) <= 1e-14 * (1 + norm(found.point))) return found.point;
    (found.inside() == a.inside() ? a : b) = found;
  }
  return a.inside() ? a.point : b.point;
}

/// Adds the pieces of the curve along which a region's boundary cuts a triangle.
class TriangleCutter {
 public:
  TriangleCutter(const SpaceRegion& region, double step, std::vector<Crease>& pieces)
      : region_(region), step_(step), pieces_(pieces) {}

  void cut(const std::array<Measured, 3>& corner) {
    int longest = 0;
    std::array<double, 3> side;
    for (int k = 0; k < 3; ++k) {
      side[k] = norm(corner[(k + 1) % 3].point - corner[k].point);
      if (side[k] > side[longest]) longest = k;
    }
    const double nearest = std::min(
        {std::abs(corner[0].distance), std::abs(corner[1].distance), std::abs(corner[2].distance)});
    // No point of a triangle is farther than 0.58 times its longest side from its nearest corner.
    if (nearest > 0.6 * side[longest]) return;
    if (side[longest] > step_) {
      const Measured &a = corner[longest], &b = corner[(longest + 1) % 3],
                     &c = corner[(longest + 2) % 3];
      const Measured middle = measured(region_, 0.5 * (a.point + b.point));
      cut({a, middle, c});
      cut({middle, b, c});
      return;
    }
    std::vector<Vec3d> ends;
    for (int k = 0; k < 3; ++k) {
      const Measured &a = corner[k], &b = corner[(k + 1) % 3];
      if (a.inside() != b.inside()) ends.push_back(crossing(region_, a, b));
    }
    if (ends.size() == 2) pieces_.push_back({ends[0], ends[1]});
  }

 private:
  const SpaceRegion& region_;
  double step_;
  std::vector<Crease>& pieces_;
};

}  // namespace

std::vector<Crease> cutting_curves(const Surface& surface, std::span<const SpaceRegion> regions,
                                   double step) {
  std::vector<Crease> pieces;
  for (const SpaceRegion& region : regions) {
    TriangleCutter cutter(region, step, pieces);
    for (const Triangle& t : surface.triangle) {
      cutter.cut({measured(region, surface.position[t[0]]),
                  measured(region, surface.position[t[1]]),
                  measured(region, surface.position[t[2]])});
    }
  }
  return pieces;
}

std::vector<Vec3d> crossings(std::span<const Crease> creases, std::span<const SpaceRegion> regions,
                             double step) {
  std::vector<Vec3d> found;
  for (const SpaceRegion& region : regions) {
    for (const auto& [from, to] : creases) {
      const double length = norm(to - from);
      const auto whole = measured(region, 0.5 * (from + to));
      if (std::abs(whole.distance) > 0.5 * length) continue;
      const auto pieces = static_cast<int>(std::ceil(std::min(length / step, 1e6)));
      Measured before = measured(region, from);
      for (int k = 1; k <= pieces; ++k) {
        const Measured after =
            measured(region, from + (static_cast<double>(k) / pieces) * (to - from));
        if (before.inside() != after.inside()) found.push_back(crossing(region, before, after));
        before = after;
      }
    }
  }
  return found;
}

bool reaches_into(const InsideSampler& sampler, const SpaceRegion& region, double depth) {
  const auto in_layer = [&](Vec3d p, double slack) {
    return std::abs(region.distance(p) + 1.5 * depth) <= 0.5 * depth + slack;
  };
  std::atomic<bool> found = false;
  sampler.visit(
      {.voxel = 0.5 * depth,
       .at_random = false,
       .wanted = [&](Vec3d middle,
                     double half) { return in_layer(middle, std::numbers::sqrt3 * half); }},
      [&](std::size_t, const SampleBlock& block) {
        for (std::size_t k = 0; k < block.offset.size() && !found; ++k) {
          if (in_layer(block.position(k), 0)) found = true;
        }
      });
  return found;
}

std::vector<Vec3d> points_on_cut(const InsideSampler& sampler, const SpaceRegion& region,
                                 double gap, std::uint64_t seed) {
  // Rows of the matrix are coordinates, its columns directions.
  Mat3d turn;
  for (int k = 0; k < 3; ++k) {
    turn(0, k) = region.edge[k].x, turn(1, k) = region.edge[k].y, turn(2, k) = region.edge[k].z;
  }
  const auto wanted = [&](Vec3d middle, double half) {
    return std::abs(region.distance(middle)) <= std::numbers::sqrt3 * half + gap;
  };
  std::vector<std::vector<Vec3d>> by_task(InsideSampler::most_tasks);
  sampler.visit({.voxel = gap, .seed = seed, .at_random = false, .turn = turn, .wanted = wanted},
                [&](std::size_t task, const SampleBlock& block) {
                  for (std::size_t k = 0; k < block.offset.size(); ++k) {
                    const Vec3d p = block.position(k);
                    if (std::abs(region.distance(p)) > 0.5 * gap) continue;
                    const Vec3d on = region.nearest_on_boundary(p);
                    if (sampler.inside(on)) by_task[task].push_back(on);
                  }
                });
  std::vector<Vec3d> points;
  for (const std::vector<Vec3d>& of_task : by_task) {
    points.insert(points.end(), of_task.begin(), of_task.end());
  }
  return points;
}

}  // namespace phyxel
