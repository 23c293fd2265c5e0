/// Extraction of one rank's share from a model.
#pragma once

#include <vector>

#include "partition/part_halo.hpp"
#include "phyxel/share.hpp"

namespace phyxel {

/// A share without connections to other ranks.
struct ModelShare {
  Model model;             ///< The phyxels of the share; `share` is null.
  Share share;             ///< The lists of the share; communicator, plan and transport are unset.
  std::vector<int> owner;  ///< The part that owns each phyxel, shape [n].
};

/// The share of a part: the phyxels that it owns, their ghosts, and the surfels whose first carrier
/// it owns. Neighbour lists keep the whole model's order, so that sums round alike. They are
/// complete for owned phyxels, empty for ghosts, and absent if a device will build them.
ModelShare share_of(const Model& whole, const PartHalo& plan, const std::vector<int>& part_of);

/// Values of a share's phyxels, from those of the whole model.
template <class T>
std::vector<T> values_of(const Share& share, const std::vector<T>& whole) {
  std::vector<T> values;
  for (const Index i : share.global_id) values.push_back(whole[i]);
  return values;
}

}  // namespace phyxel
