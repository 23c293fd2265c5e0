/// How much each carrier counts for its surfel.
#pragma once

#include <algorithm>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel {

/// Weights of a surfel's carriers over the largest of them, in the order of the carriers: only
/// ratios matter, and full weights of a small body leave the range of float. A lone carrier may be
/// out of reach (h too small) and counts as one.
inline std::vector<double> carrier_weights(const Model& model, Index surfel) {
  std::vector<double> weights;
  for (const Index i : model.surfels.carriers.row(surfel)) {
    weights.push_back(weight(norm(model.surfels.position[surfel] - model.position[i]),
                             model.neighbourhood.support[i]));
  }
  const double largest = *std::max_element(weights.begin(), weights.end());
  for (double& w : weights) w = largest > 0 ? w / largest : 1;
  return weights;
}

}  // namespace phyxel
