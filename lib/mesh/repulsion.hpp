/// Repulsion that evens out the distances between points.
#pragma once

#include <cmath>

#include "model/spatial_hash.hpp"

namespace phyxel {

/// Distance at which the repulsion ends, in spacings.
inline constexpr double repulsion_reach = 1.8;
/// Longest step of a sweep, in spacings.
inline constexpr double longest_step = 0.15;

/// Sweeps of repulsion that even out distances as well as `relaxations` of Lloyd's relaxation.
inline int repulsion_sweeps(int relaxations) { return (relaxations + 2) / 3; }

/// A hash of points for `repulsion_step`.
inline SpatialHash hash_for_repulsion(std::span<const Vec3d> point, double spacing) {
  return {point, 0.5 * repulsion_reach * spacing};
}

/// The step [m] of a point that others push away with forces (1 - r / reach)², in proportion to the
/// sum of the forces and no longer than `longest_step`. A displaced node of a cubic lattice of the
/// spacing goes 0.6 times its displacement back.
/// @param self index of the point
/// @param strength strength(index) multiplies the force of a point
template <class Strength>
Vec3d repulsion_step(const SpatialHash& hash, Vec3d place, Index self, double spacing,
                     Strength&& strength) {
  constexpr double mobility = 0.6;  // the stiffness of a cubic lattice is 1.00
  const double cut = repulsion_reach * spacing;
  Vec3d force;
  hash.visit_ball(place, cut, [&](const SpatialHash::Entry& entry) {
    const Vec3d d = place - entry.position;
    const double r2 = dot(d, d);
    if (entry.index == self || r2 >= cut * cut || r2 == 0) return;
    const double r = std::sqrt(r2), rest = 1 - r / cut;
    force += (strength(entry.index) * rest * rest / r) * d;
  });
  const Vec3d step = mobility * force;
  const double length = norm(step);
  return (length > longest_step ? longest_step / length : 1) * spacing * step;
}

}  // namespace phyxel
