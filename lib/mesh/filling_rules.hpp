/// Rules of filling a surface, point by point. Shared by the fillers on the CPU and on the GPU.
#pragma once

#include <cmath>

#include "mesh/sample_grid.hpp"
#include "mesh/triangle.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

// Distances below are in lattice constants, and were chosen by the accuracy of the clouds.

/// Clearance below which a node moves.
inline constexpr double moving_clearance = 2;
/// Clearance from which a phyxel has the volume of a cell of the lattice.
inline constexpr double regular_clearance = 3;
/// Largest clearance that is found: moving nodes meet no nodes beyond it.
inline constexpr double largest_clearance = 4;
/// A distance to a sample point of the surface counts that many times: nodes keep off the middle of
/// a face nearly as far as off a phyxel on it.
inline constexpr double sample_factor = 1.2;

/// Widths of the cells of the tables that the searches below look into.
inline constexpr double depth_cell = largest_clearance, site_cell = 2, sample_cell = 0.6;

/// True if every place within `radius` [m] of `middle` is farther than `least` [m] from a surface.
/// @param site table of the phyxels on the surface. @param farthest distance from a place on the
///   surface to the nearest of them [m]
template <class Sites>
PHYXEL_HD bool is_deep(const Sites& site, Vec3d middle, double radius, double least,
                       double farthest) {
  const double limit = radius + least + farthest;
  return site.nearest(middle, limit).distance2 > limit * limit;
}

/// The clearance of a place, in spacings; `largest_clearance` for all that is farther.
/// @param site,sample tables of the phyxels and of the sample points on the surface
/// @param spacing lattice constant [m]
template <class Sites, class Samples>
PHYXEL_HD double clearance_at(const Sites& site, const Samples& sample, Vec3d place,
                              double spacing) {
  using std::sqrt;
  const double far = largest_clearance * spacing;
  const double apart = sqrt(site.nearest(place, far).distance2);
  double clearance = apart < far ? apart : far;
  if (clearance < moving_clearance * spacing) {
    const double limit = clearance / sample_factor;
    const double sampled = sample_factor * sqrt(sample.nearest(place, limit).distance2);
    if (sampled < clearance) clearance = sampled;
  }
  return clearance / spacing;
}

/// The radius of a ball around a block's centre that contains its nodes [m].
PHYXEL_HD double radius_of_nodes(double spacing) {
  return 2 * 1.7320508075688772 * spacing;  // 2 √3
}

/// The distance at which the repulsion ends, in spacings.
inline constexpr double repulsion_reach = 1.8;
/// The longest step of a sweep, in spacings.
inline constexpr double longest_step = 0.15;

/// The sum of the forces (1 - r / reach)² that points push another one away with.
class ForceSum {
 public:
  /// Adds the force of a point. @param apart the vector from that point [m], and the square of its
  /// length [m²]; not zero. @param reach larger than its length [m]
  PHYXEL_HD void add(Vec3d apart, double distance2, double reach, double strength) {
    using std::sqrt;
    const double r = sqrt(distance2), rest = 1 - r / reach;
    sum_ += (strength * rest * rest / r) * apart;
  }
  /// The step [m] of the point, in proportion to the sum and no longer than `longest_step`. A
  /// displaced node of a cubic lattice of the spacing goes 0.6 times its displacement back.
  PHYXEL_HD Vec3d step(double spacing) const {
    using std::sqrt;
    constexpr double mobility = 0.6;  // the stiffness of a cubic lattice is 1.00
    const Vec3d step = mobility * sum_;
    const double length = sqrt(dot(step, step));
    return (length > longest_step ? longest_step / length : 1) * spacing * step;
  }

 private:
  Vec3d sum_;
};

/// The step of a point that others repel [m]. @param point table of the points
/// @param self index of the point. @param strength strength(index) multiplies the force of a point
template <class Points, class Strength>
PHYXEL_HD Vec3d step_of_repulsion(const Points& point, Vec3d place, Index self, double spacing,
                                  Strength&& strength) {
  const double reach = repulsion_reach * spacing;
  ForceSum force;
  point.visit_ball(place, reach, [&](const auto& entry) {
    const Vec3d d = place - entry.position;
    const double r2 = dot(d, d);
    if (entry.index == self || r2 >= reach * reach || r2 == 0) return;
    force.add(d, r2, reach, strength(entry.index));
  });
  return force.step(spacing);
}

/// The strength of the repulsion by a phyxel on the surface. Nodes then keep the distance from it
/// at which closed bars bend right.
inline constexpr double surface_strength = 0.85;

/// The place of a point inside after a step of repulsion; the place before it if the step would
/// leave the surface [m]. @param on_surface number of phyxels on the surface, which come first
/// @param step_of step_of(strength) is the step [m], with a strength for each other point
/// @param stays stays(after) tells whether a place after the step is inside
template <class StepOf, class Stays>
PHYXEL_HD Vec3d repelled_inside(Index on_surface, Vec3d before, StepOf&& step_of, Stays&& stays) {
  bool beside_surface = false;
  const auto strength = [&](Index other) {
    beside_surface |= other < on_surface;
    return other < on_surface ? surface_strength : 1.0;
  };
  const Vec3d after = before + step_of(strength);
  // Only nodes beside phyxels on the surface can leave it.
  return !beside_surface || stays(after) ? after : before;
}

/// The place of a point on a face after a step, on the triangle nearest to where the step along its
/// own triangle ends [m]. @param piece the point's triangle; receives the new one
/// @param corners_of corners_of(triangle) are its corners [m]
/// @param nearest_piece nearest_piece(place) is the triangle near a place
template <class CornersOf, class NearestPiece>
PHYXEL_HD Vec3d moved_on_face(Vec3d before, Vec3d step, std::size_t& piece, CornersOf&& corners_of,
                              NearestPiece&& nearest_piece) {
  const Corners own = corners_of(piece);
  const Vec3d normal = cross(own.b - own.a, own.c - own.a);
  const double size2 = dot(normal, normal);
  if (size2 > 0) step -= (dot(step, normal) / size2) * normal;
  const Vec3d after = before + step;
  piece = nearest_piece(after);
  const Corners near = corners_of(piece);
  return nearest_on_triangle(after, near.a, near.b, near.c);
}

/// The width of the cells of the table of sample points on faces, in spacings.
inline constexpr double face_sample_cell = 0.4;

/// The rank of a sample point among others, in a random order; no two have the same.
PHYXEL_HD std::uint64_t rank_of(std::uint64_t sample, std::uint64_t seed) {
  return mix_bits(mix_bits(seed ^ mix_bits(sample)));
}

/// A factor by which searches for the nearest sites reach too far, for the sake of rounding.
inline constexpr double site_slack = 1 + 1e-6;

/// False if a site cannot be nearest to any point of a ball: if the plane half-way between it and
/// the site nearest to the middle does not cut the ball.
/// @param apart vector from the middle to the site, and @param nearest to the nearest site [m]
PHYXEL_HD bool may_be_nearest(Vec3d apart, Vec3d nearest, double radius) {
  const double beyond = dot(apart, apart) - dot(nearest, nearest);
  const Vec3d between = apart - nearest;
  return !(beyond > 0 &&
           beyond * beyond > 4 * radius * radius * site_slack * dot(between, between));
}

/// Calls visit(entry) for the sites that may be nearest to a point of a ball.
/// @param site table of the sites
template <class Sites, class Visit>
PHYXEL_HD void visit_nearest_sites(const Sites& site, Vec3d middle, double radius, Visit&& visit) {
  using std::sqrt;
  const Vec3d nearest = site.nearest(middle).apart;
  // Sites farther away are beyond the planes, too.
  const double reach = (sqrt(dot(nearest, nearest)) + 2 * radius) * site_slack;
  site.visit_ball(middle, reach, [&](const auto& entry) {
    if (may_be_nearest(entry.position - middle, nearest, radius)) visit(entry);
  });
}

/// The radius of a ball around a block's centre that contains points of it [m].
/// @param largest2 the largest square of the points' distances from it [m²]
PHYXEL_HD double radius_of_block(float largest2) {
  using std::sqrt;
  return sqrt(static_cast<double>(largest2)) * site_slack;
}

}  // namespace phyxel
