/// Interface to METIS; only its source includes metis.h.
#pragma once

#include <vector>

#include "partition/graph.hpp"

namespace phyxel {

/// A k-way partition with a small edge cut and weights balanced to 1%.
/// @param parts at least 2, and fewer than the graph has vertices
/// @throws InputError if the graph is too large for METIS's indices
/// @throws Error if METIS fails
std::vector<int> metis_partition(const Graph& graph, int parts);

}  // namespace phyxel
