/// Which phyxels hang together.
#pragma once

#include <span>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The label of each phyxel, which is the least global id of the phyxels that unbroken pairs
/// connect with it, over all ranks; shape [n], of a share with its ghosts. Collective on a share.
/// @param broken broken pairs as of `State::broken`
std::vector<Index> fragment_labels(const Model& model, std::span<const PhyxelPair> broken);

}  // namespace phyxel
