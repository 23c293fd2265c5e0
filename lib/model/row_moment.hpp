/// The moment of a phyxel's row of neighbours.
#pragma once

#include "model/parts.hpp"
#include "model/row_weights.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/row_moment.hpp"

namespace phyxel {

/// Returns the sums over the neighbours j of phyxel i for which counts(j) is true, in the order of
/// its list.
template <class Counts>
RowMoment moment_of_row(const Model& model, Index i, Counts&& counts) {
  RowMoment sums;
  const RowWeights weights(model.neighbourhood.support.data(), i, part_of(model, i).pair_length);
  for (const Index j : model.neighbourhood.neighbours.row(i)) {
    if (!counts(j)) continue;
    const Vec3d x = model.position[j] - model.position[i];
    sums.add(x, weights(j, dot(x, x)));
  }
  return sums;
}

}  // namespace phyxel
