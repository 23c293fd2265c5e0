/// Grading: bodies whose phyxels are nearer to each other in some places than in others.
#pragma once

#include <optional>
#include <vector>

#include "phyxel/space_region.hpp"

namespace phyxel {

/// Where the phyxels of a body are to be nearer to each other than elsewhere.
struct Grading {
  double ratio = 4;      ///< Largest over smallest distance between neighbours, 1 to 10.
  double growth = 0.25;  ///< Growth of that distance along a path, by its length; 0.05 to 0.5.
  /// Phyxels over a radius of curvature of the surface; 0: however it curves. Unset: 8, or 0 where
  /// there are finer regions.
  std::optional<double> per_radius;
  /// Phyxels through thin places, two at least. Unset: 5, or 2 where there are finer regions.
  std::optional<double> across;
  /// A region in which phyxels are nearer to each other.
  struct Finer {
    SpaceRegion region;
    double by = 1;  ///< The coarsest distance between neighbours over the one here, 1 to `ratio`.
    bool operator==(const Finer&) const = default;
  };
  std::vector<Finer> finer;
  bool operator==(const Grading&) const = default;
};

}  // namespace phyxel
