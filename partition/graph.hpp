/// What is cut into parts: phyxels, or groups of them, and who needs whom.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// Vertices with what they cost, edges with what crosses them. Symmetric, without loops.
struct Graph {
  std::vector<Offset> offsets{0};           ///< Shape [vertices + 1].
  std::vector<Index> neighbours;            ///< Ascending in each row.
  std::vector<std::int64_t> edge_weight;    ///< Of each entry, the same both ways; empty: 1 each.
  std::vector<std::int64_t> vertex_weight;  ///< Shape [vertices].
  std::vector<Vec3d> centre;                ///< [m], shape [vertices].

  Index vertices() const { return static_cast<Index>(vertex_weight.size()); }
  std::span<const Index> row(Index v) const {
    return {neighbours.data() + offsets[v], neighbours.data() + offsets[v + 1]};
  }
  std::int64_t weight_of_edge(Offset entry) const {
    return edge_weight.empty() ? 1 : edge_weight[entry];
  }
  std::int64_t total_weight() const;
};

/// Weight of each part, shape [parts].
std::vector<std::int64_t> part_weights(const Graph& graph, const std::vector<int>& part_of,
                                       int parts);

/// A vertex for each phyxel, an edge where one is a neighbour of the other. A phyxel costs its
/// neighbours and one more, an edge 1.
Graph phyxel_graph(const Model& model);

/// Phyxels gathered in groups: the group of each, shape [n].
struct Groups {
  std::vector<Index> of;
  Index count = 0;
};

/// `size` at a time along Hilbert's curve, each body from the start of a group: what a GPU keeps
/// together as a tile.
Groups curve_groups(const Model& model, int size);

/// A vertex for each group: weights are the sums of what it stands for, its centre the mean.
Graph grouped_graph(const Graph& graph, const Groups& groups);

}  // namespace phyxel
