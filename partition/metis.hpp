/// METIS behind a function of ours: the only file that includes metis.h is its source.
#pragma once

#include <vector>

#include "partition/graph.hpp"

namespace phyxel {

/// k-way parts of few cut edges, weights balanced to 1%.
/// @param parts at least 2, fewer than vertices
/// @throws InputError for graphs that METIS's indices cannot name; Error if it fails
std::vector<int> metis_partition(const Graph& graph, int parts);

}  // namespace phyxel
