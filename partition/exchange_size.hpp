/// What parts of a body would send each other in a step, counted.
#pragma once

#include <cstdint>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// Real numbers that all parts together send in a step. There are three ways to give every phyxel
/// the forces of its neighbours in other parts; each sends the displacements of ghosts as well.
struct ExchangeSize {
  /// The pair stress of each ghost, nine numbers. This is what ranks send: the part that owns a
  /// phyxel then finds every force on it, and sums them in one order, whatever the cut.
  std::int64_t pair_stresses = 0;
  /// The force of each phyxel on each neighbour in another part, three numbers: the same sum in the
  /// same order.
  std::int64_t pair_forces = 0;
  /// The same forces, summed over a part before they are sent: three numbers for each ghost. The
  /// order of the sum is then the cut's.
  std::int64_t summed_forces = 0;
};

/// @param part_of the part of each phyxel
ExchangeSize exchange_size(const Model& model, const std::vector<int>& part_of);

}  // namespace phyxel
