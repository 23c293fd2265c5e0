/// Which phyxels of a body a scene means.
#pragma once

#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

/// Sorted indices of the selected phyxels within the cloud (already placed).
/// @throws InputError if nothing is selected, a region is unknown or an index out of range.
std::vector<Index> select(const Selection& selection, const Cloud& cloud, const std::string& body);

}  // namespace phyxel
