/// Grading: bodies whose phyxels are nearer to each other in some places than in others.
#pragma once

#include <vector>

#include "phyxel/space_region.hpp"

namespace phyxel {

/// Where the phyxels of a body are to be nearer to each other than elsewhere.
struct Grading {
  double ratio = 4;       ///< Largest over smallest distance between neighbours, 1 to 10.
  double growth = 0.25;   ///< Growth of that distance along a path, by its length; 0.05 to 0.5.
  double per_radius = 4;  ///< Phyxels over a radius of curvature of the surface; 0: as it comes.
  double across = 5;      ///< Phyxels through thin places; 0: as it comes.
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
