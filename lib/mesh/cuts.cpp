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

/// The cosine of the largest angle that is sharp, 60 degrees.
constexpr double sharp_cosine = 0.5;

/// Adds the pieces of the curve along which a region's boundary cuts a triangle.
class TriangleCutter {
 public:
  TriangleCutter(const SpaceRegion& region, double step, CuttingCurves& curves)
      : region_(region), step_(step), curves_(curves) {}

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
    if (ends.size() == 2) add({ends[0], ends[1]}, corner);
  }

 private:
  void add(const Crease& piece, const std::array<Measured, 3>& corner) {
    curves_.piece.push_back(piece);
    const Vec3d on = region_.nearest_on_boundary(piece.from),
                outward = on - region_.nearest_on_boundary(piece.from, 1e-3 * step_),
                normal =
                    cross(corner[1].point - corner[0].point, corner[2].point - corner[0].point);
    if (std::abs(dot(outward, normal)) > sharp_cosine * norm(outward) * norm(normal)) {
      curves_.sharp.push_back(0.5 * (piece.from + piece.to));
    }
  }

  const SpaceRegion& region_;
  double step_;
  CuttingCurves& curves_;
};

/// Sides of a box of which the shortest is less than this many spacings leave no room for two
/// layers of phyxels.
constexpr double thin = 0.8;
/// Distance from the end of a body within which a box ends with it, in spacings.
constexpr double flush = 0.35;
/// Distance from a cut within which other phyxels may be too near to it, in spacings.
constexpr double margin = 0.4;
/// Length of the wedge beside a curve of sharp angles, in spacings.
constexpr double wedge = 2.5;
/// Radius of the balls in which the body's thickness beside a cut is measured, in spacings: in a
/// layer of even thickness, phyxels need 0.4 spacings.
constexpr double thin_radius = 1.2;

/// Points spread evenly over a unit ball: spirals on three spheres.
std::vector<Vec3d> points_of_ball() {
  std::vector<Vec3d> points;
  for (const auto& [radius, count] :
       {std::pair{0.45, 6}, std::pair{0.72, 15}, std::pair{0.93, 27}}) {
    for (int k = 0; k < count; ++k) {
      const double z = (2 * k + 1.0) / count - 1, across = std::sqrt(1 - z * z);
      const double angle = 2 * std::numbers::pi * (1 - 1 / std::numbers::phi) * k;
      points.push_back(radius * Vec3d{across * std::cos(angle), across * std::sin(angle), z});
    }
  }
  return points;
}

double& component_of(Vec3d& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// A region whose faces that are beyond the body, or nearly so, are moved well away from it.
SpaceRegion beyond_body(const SpaceRegion& region, const Surface& surface, double slack) {
  SpaceRegion made = region;
  if (region.is_ball) {
    double farthest = 0;
    for (const Triangle& t : surface.triangle) {
      for (const Index corner : t) {
        farthest = std::max(farthest, norm(surface.position[corner] - region.centre));
      }
    }
    if (region.radius > farthest - slack) made.radius = 2 * (region.radius + farthest);
    return made;
  }
  for (int k = 0; k < 3; ++k) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const Triangle& t : surface.triangle) {
      for (const Index corner : t) {
        const double at = dot(region.edge[k], surface.position[corner]);
        low = std::min(low, at), high = std::max(high, at);
      }
    }
    const double away = high - low;
    if (component(region.low, k) < low + slack) component_of(made.low, k) = low - away;
    if (component(region.high, k) > high - slack) component_of(made.high, k) = high + away;
  }
  return made;
}

/// Counts sample points inside a surface by kind.
/// @param kind kind(point) returns the kind of a point, 0 or 1, or -1 if the point does not count
/// @param near near(middle, radius) returns false if no point of a ball counts
template <class Kind, class Near>
std::array<int, 2> count_points(const InsideSampler& sampler, double voxel, Kind&& kind,
                                Near&& near) {
  std::atomic<int> count[2] = {0, 0};
  sampler.visit({.voxel = voxel,
                 .at_random = false,
                 .wanted = [&](Vec3d middle,
                               double half) { return near(middle, std::numbers::sqrt3 * half); }},
                [&](std::size_t, const SampleBlock& block) {
                  for (std::size_t k = 0; k < block.offset.size(); ++k) {
                    const int of_point = kind(block.position(k));
                    if (of_point >= 0) ++count[of_point];
                  }
                });
  return {count[0], count[1]};
}

/// True if a region reaches into the inside of a surface by more than `depth` [m].
bool reaches_into(const InsideSampler& sampler, const SpaceRegion& region, double depth) {
  // A layer, since the part of a region that is deeper may be large.
  const auto in_layer = [&](Vec3d p, double slack) {
    return std::abs(region.distance(p) + 1.5 * depth) <= 0.5 * depth + slack;
  };
  const std::array<int, 2> found = count_points(
      sampler, 0.25 * depth, [&](Vec3d p) { return in_layer(p, 0) ? 0 : -1; }, in_layer);
  return found[0] > 0;
}

/// True if the body goes on for half a spacing on both sides of a thin box's middle.
bool goes_through(const InsideSampler& sampler, const SpaceRegion& box, int axis, double spacing) {
  const double middle = 0.5 * (component(box.low, axis) + component(box.high, axis));
  SpaceRegion layer = box;
  component_of(layer.low, axis) = middle - 0.5 * spacing;
  component_of(layer.high, axis) = middle + 0.5 * spacing;
  const auto side = [&](Vec3d p) { return dot(box.edge[axis], p) < middle ? 0 : 1; };
  const std::array<int, 2> found = count_points(
      sampler, 0.125 * spacing, [&](Vec3d p) { return layer.contains(p) ? side(p) : -1; },
      [&](Vec3d p, double radius) { return layer.distance(p) <= radius; });
  return std::min(found[0], found[1]) > 0.5 * std::max(found[0], found[1]);
}

}  // namespace

PlannedCut plan_cut(const InsideSampler& sampler, const Surface& surface, const SpaceRegion& region,
                    double spacing) {
  PlannedCut planned{.boundary = beyond_body(region, surface, flush * spacing)};
  SpaceRegion& box = planned.boundary;
  double shortest = 2 * region.radius;
  int axis = 0;
  if (!region.is_ball) {
    for (int k = 1; k < 3; ++k) {
      const auto side = [&](int of) { return component(box.high, of) - component(box.low, of); };
      if (side(k) < side(axis)) axis = k;
    }
    shortest = component(box.high, axis) - component(box.low, axis);
  }
  if (shortest >= thin * spacing) {
    const double depth = std::min(0.5 * spacing, 0.2 * shortest);
    planned.is_cut = planned.has_inside = reaches_into(sampler, box, depth);
  } else if (!region.is_ball && goes_through(sampler, box, axis, spacing)) {
    planned.is_cut = true;
    component_of(box.low, axis) = 0.5 * (component(box.low, axis) + component(box.high, axis));
  }
  return planned;
}

CuttingCurves cutting_curves(const Surface& surface, const SpaceRegion& region, double step) {
  CuttingCurves curves;
  TriangleCutter cutter(region, step, curves);
  for (const Triangle& t : surface.triangle) {
    cutter.cut({measured(region, surface.position[t[0]]), measured(region, surface.position[t[1]]),
                measured(region, surface.position[t[2]])});
  }
  return curves;
}

std::vector<Vec3d> crossings(std::span<const Crease> creases, std::span<const SpaceRegion> regions,
                             double step) {
  std::vector<Vec3d> found;
  for (const SpaceRegion& region : regions) {
    for (const auto& [from, to] : creases) {
      const double length = norm(to - from);
      const auto whole = measured(region, 0.5 * (from + to));
      // A crease that ends on the boundary may seem to end before it, by rounding.
      if (std::abs(whole.distance) > 0.5 * length + 1e-9 * step) continue;
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

CutMargin::CutMargin(const InsideSampler& sampler, std::span<const CutFace> faces,
                     const SpacingField& spacing)
    : sampler_(sampler), spacing_(spacing) {
  for (const CutFace& face : faces) {
    if (face.border.sharp.empty()) continue;
    std::vector<Vec3d> points = face.points;
    for (const auto& [from, to] : face.border.piece) {
      points.insert(points.end(), {from, 0.5 * (from + to), to});
    }
    faces_.push_back({face.region, SpatialHash(points, margin * spacing.coarsest()),
                      SpatialHash(face.border.sharp, wedge * spacing.coarsest())});
  }
}

bool CutMargin::contains(Vec3d place) const {
  for (const Face& face : faces_) {
    const double spacing = spacing_.at(place), reach = margin * spacing, length = wedge * spacing;
    if (std::abs(face.region.distance(place)) >= reach) continue;
    if (face.sharp.nearest(place, length).distance2 >= length * length) continue;
    // The boundary goes on outside the body, where it cuts nothing.
    const Vec3d foot = face.region.nearest_on_boundary(place);
    if (face.points.nearest(foot, reach).distance2 >= reach * reach) continue;
    if (is_thin(place, face.region, spacing)) return true;
  }
  return false;
}

/// True if most of the body near a place is on the other side of a region's boundary.
bool CutMargin::is_thin(Vec3d place, const SpaceRegion& region, double spacing) const {
  static const std::vector<Vec3d> ball_points = points_of_ball();
  const bool here = region.contains(place);
  // Winding numbers take most of the time: those of the points on this side are found only until
  // they are as many as those on the other side.
  int more = 0;  // on the other side
  for (const bool on_this_side : {false, true}) {
    for (const Vec3d& offset : ball_points) {
      const Vec3d p = place + thin_radius * spacing * offset;
      if ((region.contains(p) == here) != on_this_side) continue;
      if (on_this_side && more <= 0) return false;
      if (sampler_.inside(p)) more += on_this_side ? -1 : 1;
    }
  }
  return more > 0;
}

}  // namespace phyxel
