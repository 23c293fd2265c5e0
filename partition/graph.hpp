/// The dual graph that partitioners cut: phyxels or groups of them, and their neighbours.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// A symmetric graph without loops, in CSR form. Vertex weights are computational costs, edge
/// weights communication costs.
struct Graph {
  std::vector<Offset> offsets{0};           ///< Shape [vertices + 1].
  std::vector<Index> neighbours;            ///< Ascending in each row.
  std::vector<std::int64_t> edge_weight;    ///< Symmetric, one for each entry; if empty, all are 1.
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

/// Sum of the vertex weights of each part, shape [parts].
std::vector<std::int64_t> part_weights(const Graph& graph, const std::vector<int>& part_of,
                                       int parts);

/// The dual graph of a model: a vertex for each phyxel, and an edge between two phyxels if either
/// is a neighbour of the other. The weight of a vertex is one plus its number of neighbours, that
/// of an edge is 1.
Graph phyxel_graph(const Model& model);

/// Groups of phyxels that a partition does not cut.
struct Groups {
  std::vector<Index> of;
  Index count = 0;
};

/// Groups of `size` consecutive phyxels along the Hilbert curve, starting anew with each body: the
/// tiles of a GPU.
Groups curve_groups(const Model& model, int size);

/// The graph of groups. Weights are sums over the phyxels of a group, and its centre is their mean.
Graph grouped_graph(const Graph& graph, const Groups& groups);

}  // namespace phyxel
