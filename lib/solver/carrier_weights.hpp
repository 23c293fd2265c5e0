/// Weights of the phyxels that carry a surfel.
#pragma once

#include <algorithm>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/weight.hpp"
#include "solver/crack_sides.hpp"

namespace phyxel {

/// Returns the weights of a surfel's carriers divided by the largest of them, in the order of the
/// carriers: only ratios matter, and full weights of a small body leave the range of float. The
/// weight of a lone carrier is one, even if the surfel is outside its support.
/// @param sides carriers on the other side of a crack have weight zero
inline std::vector<double> carrier_weights(const Model& model, Index surfel,
                                           const CrackSides& sides = {}) {
  const auto row = model.surfels.carriers.row(surfel);
  const std::vector<char> kept = sides.on_side(model, surfel);
  std::vector<double> weights;
  for (std::size_t k = 0; k < row.size(); ++k) {
    const double distance = norm(model.surfels.position[surfel] - model.position[row[k]]);
    weights.push_back(kept[k] ? weight(distance, model.neighbourhood.support[row[k]]) : 0);
  }
  const double largest = *std::max_element(weights.begin(), weights.end());
  for (std::size_t k = 0; k < row.size(); ++k) {
    weights[k] = largest > 0 ? weights[k] / largest : kept[k];
  }
  return weights;
}

}  // namespace phyxel
