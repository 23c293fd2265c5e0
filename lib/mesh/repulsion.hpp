/// Repulsion that evens out the distances between points.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/filling_rules.hpp"
#include "mesh/point_tree.hpp"
#include "mesh/spacing_field.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {

/// Sweeps of repulsion that even out distances as well as `relaxations` of Lloyd's relaxation.
inline int repulsion_sweeps(int relaxations) { return (relaxations + 2) / 3; }

/// Points that push each other away until all have the same distances.
class Repulsion {
 public:
  /// @param spacing the distance [m]
  Repulsion(std::span<const Vec3d> point, double spacing)
      : spacing_(spacing), hash_(point, 0.5 * repulsion_reach * spacing) {}

  /// The step of a point [m]. @param self index of the point
  /// @param strength strength(index) multiplies the force of a point
  template <class Strength>
  Vec3d step(Vec3d place, Index self, Strength&& strength) const {
    return step_of_repulsion(hash_, place, self, spacing_, strength);
  }

 private:
  double spacing_;  ///< [m]
  SpatialHash hash_;
};

/// Points that push each other away until they have the distances of a spacing field. Those that
/// push the points of a leaf of a tree are found together.
///
/// Where spacings s differ, a pair has the mean of its own, and the energy of a force grows as s³:
/// then the pressure of points with the wanted distances is the same everywhere, and does not push
/// fine ones among coarse ones.
class GradedRepulsion {
 public:
  /// @param fixed number of points that come first and never move
  /// @param spacing must outlive the repulsion
  GradedRepulsion(std::span<const Vec3d> point, std::size_t fixed, const SpacingField& spacing);

  /// Takes over the points' new places, which should not be far from those before [m].
  void move_to(std::span<const Vec3d> point);

  /// Calls move(i, step_of) for each point i that may move, on many threads. step_of(strength)
  /// returns the step of the point [m]; strength(index) multiplies the force of another point.
  template <class Move>
  void for_each(Move&& move) const {
#pragma omp parallel
    {
      std::vector<Placed> near;
      std::vector<std::uint32_t> reached;
#pragma omp for schedule(dynamic, 16)
      for (std::size_t leaf = 0; leaf < tree_.leaves(); ++leaf) {
        if (!moves_[leaf]) continue;
        find_near(leaf, near);
        for (std::size_t k = tree_.first_of(leaf); k < tree_.first_of(leaf + 1); ++k) {
          const Placed& self = point_[k];
          if (static_cast<std::size_t>(self.index) < fixed_) continue;
          move(static_cast<std::size_t>(self.index),
               [&](auto&& strength) { return step(self, near, reached, strength); });
        }
      }
    }
  }

 private:
  struct Placed {
    Vec3d place;     ///< [m]
    double spacing;  ///< [m]
    Index index;
  };

  void find_near(std::size_t leaf, std::vector<Placed>& near) const;

  /// @param near points that may reach the point. @param reached is work space
  template <class Strength>
  Vec3d step(const Placed& self, const std::vector<Placed>& near,
             std::vector<std::uint32_t>& reached, Strength&& strength) const {
    constexpr double half_reach = 0.5 * repulsion_reach;
    reached.resize(near.size());
    std::size_t count = 0;
    for (std::size_t j = 0; j < near.size(); ++j) {
      const Vec3d d = self.place - near[j].place;
      const double reach = half_reach * (self.spacing + near[j].spacing);
      reached[count] = static_cast<std::uint32_t>(j);
      count += dot(d, d) < reach * reach;
    }
    ForceSum force;
    for (std::size_t k = 0; k < count; ++k) {
      const Placed& other = near[reached[k]];
      const Vec3d d = self.place - other.place;
      const double r2 = dot(d, d);
      if (r2 == 0) continue;
      const double of_pair = 0.5 * (self.spacing + other.spacing), ratio = of_pair / self.spacing;
      force.add(d, r2, repulsion_reach * of_pair, strength(other.index) * ratio * ratio);
    }
    return force.step(self.spacing);
  }

  std::size_t fixed_;
  const SpacingField& spacing_;
  PointTree tree_;
  std::vector<Placed> point_;        ///< In the order of the tree.
  std::vector<double> coarsest_;     ///< The largest spacing of each node [m].
  std::vector<std::uint8_t> moves_;  ///< 1 for each leaf with a point that may move.
};

}  // namespace phyxel
