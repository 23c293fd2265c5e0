#include "partition/graph.hpp"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "model/space_filling_curve.hpp"

namespace phyxel {

std::int64_t Graph::total_weight() const {
  return std::accumulate(vertex_weight.begin(), vertex_weight.end(), std::int64_t{0});
}

std::vector<std::int64_t> part_weights(const Graph& graph, const std::vector<int>& part_of,
                                       int parts) {
  std::vector<std::int64_t> weights(static_cast<std::size_t>(parts), 0);
  for (Index v = 0; v < graph.vertices(); ++v) weights[part_of[v]] += graph.vertex_weight[v];
  return weights;
}

Graph phyxel_graph(const Model& model) {
  const Neighbourhood& hood = model.with_lists().neighbourhood;
  Graph graph;
  graph.centre = model.position;
  graph.offsets.reserve(static_cast<std::size_t>(model.size()) + 1);
  graph.neighbours.reserve(static_cast<std::size_t>(hood.neighbours.entries()));
  for (Index i = 0; i < model.size(); ++i) {
    const auto near = hood.neighbours.row(i), far = hood.inverse().row(i);
    std::set_union(near.begin(), near.end(), far.begin(), far.end(),
                   std::back_inserter(graph.neighbours));
    graph.offsets.push_back(static_cast<Offset>(graph.neighbours.size()));
    graph.vertex_weight.push_back(1 + static_cast<std::int64_t>(near.size()));
  }
  return graph;
}

Groups curve_groups(const Model& model, int size) {
  Groups groups;
  groups.of.resize(static_cast<std::size_t>(model.size()));
  for (const Part& part : model.parts) {
    const std::vector<Index> order = curve_order(model.position, part.begin, part.end);
    const auto count = static_cast<Index>(order.size());
    for (Index k = 0; k < count; ++k) groups.of[order[k]] = groups.count + k / size;
    groups.count += (count + size - 1) / size;
  }
  return groups;
}

Graph grouped_graph(const Graph& graph, const Groups& groups) {
  std::vector<std::vector<Index>> members(static_cast<std::size_t>(groups.count));
  for (Index v = 0; v < graph.vertices(); ++v) members[groups.of[v]].push_back(v);
  Graph coarse;
  std::vector<std::pair<Index, std::int64_t>> crossing;  // other group, weight
  for (Index g = 0; g < groups.count; ++g) {
    crossing.clear();
    std::int64_t weight = 0;
    Vec3d centre;
    for (const Index v : members[g]) {
      weight += graph.vertex_weight[v];
      centre += 1.0 / static_cast<double>(members[g].size()) * graph.centre[v];
      for (Offset e = graph.offsets[v]; e < graph.offsets[v + 1]; ++e) {
        const Index other = groups.of[graph.neighbours[e]];
        if (other != g) crossing.emplace_back(other, graph.weight_of_edge(e));
      }
    }
    std::sort(crossing.begin(), crossing.end());
    for (std::size_t k = 0; k < crossing.size(); ++k) {
      if (k > 0 && crossing[k].first == crossing[k - 1].first) {
        coarse.edge_weight.back() += crossing[k].second;
      } else {
        coarse.neighbours.push_back(crossing[k].first);
        coarse.edge_weight.push_back(crossing[k].second);
      }
    }
    coarse.offsets.push_back(static_cast<Offset>(coarse.neighbours.size()));
    coarse.vertex_weight.push_back(weight);
    coarse.centre.push_back(centre);
  }
  return coarse;
}

}  // namespace phyxel
