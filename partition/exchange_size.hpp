/// Communication volume of a step, by three ways to exchange forces.
#pragma once

#include <cstdint>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// Number of reals that all parts together send in a step. There are three ways to exchange the
/// forces between phyxels of different parts; each also sends the displacements of ghosts.
struct ExchangeSize {
  /// The pair stress of each ghost, nine numbers: the way that ranks use. The owner of a phyxel
  /// then evaluates all forces on it, and sums them in an order that does not depend on the
  /// partition.
  std::int64_t pair_stresses = 0;
  /// The force of each phyxel on each neighbour in another part, three numbers, summed in the same
  /// order.
  std::int64_t pair_forces = 0;
  /// The forces of a part on each ghost, summed before they are sent: three numbers. The order of
  /// the sum then depends on the partition.
  std::int64_t summed_forces = 0;
};

/// Counts the numbers that the parts of a model send in a step.
/// @param part_of the part of each phyxel
ExchangeSize exchange_size(const Model& model, const std::vector<int>& part_of);

}  // namespace phyxel
