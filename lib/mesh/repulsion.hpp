/// Repulsion that evens out the distances between points.
#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "mesh/spacing_field.hpp"
#include "model/graded_hash.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {

/// Distance at which the repulsion ends, in spacings.
inline constexpr double repulsion_reach = 1.8;
/// Longest step of a sweep, in spacings.
inline constexpr double longest_step = 0.15;

/// Sweeps of repulsion that even out distances as well as `relaxations` of Lloyd's relaxation.
inline int repulsion_sweeps(int relaxations) { return (relaxations + 2) / 3; }

/// Points that push each other away with forces (1 - r / reach)² until they have the distances of a
/// spacing field.
///
/// Where spacings s differ, a pair has the mean of its own, and the energy of a force grows as s³:
/// then the pressure of points with the wanted distances is the same everywhere, and does not push
/// fine ones among coarse ones.
class Repulsion {
 public:
  Repulsion(std::span<const Vec3d> point, const SpacingField& spacing);

  /// The step [m] of a point, in proportion to the sum of the forces and no longer than
  /// `longest_step`. A displaced node of a cubic lattice of the spacing goes 0.6 times its
  /// displacement back.
  /// @param self index of the point
  /// @param strength strength(index) multiplies the force of a point
  template <class Strength>
  Vec3d step(Vec3d place, Index self, Strength&& strength) const {
    const double spacing = graded_ ? size_[self] : spacing_;
    Vec3d force;
    const auto add = [&](const SpatialHash::Entry& entry) {
      const Vec3d d = place - entry.position;
      const double of_pair = graded_ ? 0.5 * (spacing + size_[entry.index]) : spacing;
      const double cut = repulsion_reach * of_pair, r2 = dot(d, d);
      if (entry.index == self || r2 >= cut * cut || r2 == 0) return;
      const double r = std::sqrt(r2), rest = 1 - r / cut;
      double by = strength(entry.index);
      if (graded_) by *= of_pair * of_pair / (spacing * spacing);
      force += (by * rest * rest / r) * d;
    };
    if (graded_) {
      graded_->visit_ball(
          place, [&](double largest) { return repulsion_reach * 0.5 * (spacing + largest); }, add);
    } else {
      uniform_->visit_ball(place, repulsion_reach * spacing, add);
    }
    constexpr double mobility = 0.6;  // the stiffness of a cubic lattice is 1.00
    const Vec3d step = mobility * force;
    const double length = norm(step);
    return (length > longest_step ? longest_step / length : 1) * spacing * step;
  }

 private:
  double spacing_;            ///< If it is one [m].
  std::vector<double> size_;  ///< Else, of each point [m].
  std::optional<SpatialHash> uniform_;
  std::optional<GradedHash> graded_;
};

}  // namespace phyxel
