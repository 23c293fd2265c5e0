/// Weights of the phyxels that carry a surfel.
#pragma once

#include <algorithm>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel {

/// Returns the weights of a surfel's carriers divided by the largest of them, in the order of the
/// carriers: only ratios matter, and full weights of a small body leave the range of float. The
/// weight of a lone carrier is one, even if the surfel is outside its support.
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
