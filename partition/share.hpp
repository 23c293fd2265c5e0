/// What one rank has of a model.
#pragma once

#include <vector>

#include "partition/part_halo.hpp"
#include "phyxel/share.hpp"

namespace phyxel {

/// A share that is not connected with the other ranks yet.
struct ModelShare {
  Model model;             ///< `share` is null.
  Share share;             ///< Without communicator, plan and transport.
  std::vector<int> owner;  ///< The part that each phyxel belongs to, shape [n].
};

/// The phyxels that a plan owns and their ghosts, and the surfels whose first carrier it owns.
/// Lists keep the order that they have in the whole model, so that sums run alike; they are whole
/// for own phyxels and empty for ghosts; there are none if the whole model's are left to a device.
ModelShare share_of(const Model& whole, const PartHalo& plan, const std::vector<int>& part_of);

/// Values of all phyxels of the whole model, for those of a share.
template <class T>
std::vector<T> values_of(const Share& share, const std::vector<T>& whole) {
  std::vector<T> values;
  for (const Index i : share.global_id) values.push_back(whole[i]);
  return values;
}

}  // namespace phyxel
