/// The moment of a phyxel's row of neighbours.
#pragma once

#include "phyxel/physics/moment.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Sums over the neighbours of a phyxel.
struct RowMoment {
  Sym3<double> moment;  ///< A = Σ_j w_ij x_ij x_ijᵀ [m²]
  Vec3<double> offset;  ///< b = Σ_j w_ij x_ij [m]

  /// Adds a neighbour. @param x x_ij [m]. @param w its weight
  PHYXEL_HD void add(Vec3<double> x, double w) {
    moment += moment_term(x, w);
    offset += w * x;
  }
};

}  // namespace phyxel
