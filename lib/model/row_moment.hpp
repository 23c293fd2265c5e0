/// The moment of a phyxel's row of neighbours.
#pragma once

#include "model/parts.hpp"
#include "model/row_weights.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/moment.hpp"

namespace phyxel {

/// Sums over the neighbours of a phyxel.
struct RowMoment {
  Sym3d moment;  ///< A = Σ_j w_ij x_ij x_ijᵀ [m²]
  Vec3d offset;  ///< b = Σ_j w_ij x_ij [m]
};

/// Returns the sums over the neighbours j of phyxel i for which counts(j) is true, in the order of
/// its list.
template <class Counts>
RowMoment moment_of_row(const Model& model, Index i, Counts&& counts) {
  RowMoment sums;
  const RowWeights weights(model.neighbourhood.support.data(), i, part_of(model, i).pair_length);
  for (const Index j : model.neighbourhood.neighbours.row(i)) {
    if (!counts(j)) continue;
    const Vec3d x = model.position[j] - model.position[i];
    const double w = weights(j, dot(x, x));
    sums.moment += moment_term(x, w);
    sums.offset += w * x;
  }
  return sums;
}

}  // namespace phyxel
