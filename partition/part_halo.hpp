/// The halo of each part of a graph: its ghosts, and which part sends what to which; plain values,
/// made and checked without ranks.
#pragma once

#include <vector>

#include "partition/graph.hpp"

namespace phyxel {

/// One part's view. All lists name vertices of the whole graph, ascending.
struct PartHalo {
  int part = 0;
  std::vector<Index> owned;
  std::vector<Index> boundary;  ///< Owned ones with a neighbour that is not.
  std::vector<Index> ghosts;    ///< Neighbours of owned vertices that other parts own.
  /// What one other part and this one exchange.
  struct Peer {
    int part = 0;
    std::vector<Index> send, receive;
  };
  std::vector<Peer> peers;  ///< Ascending; those with anything to send or to receive.
};

/// The halos of all parts.
std::vector<PartHalo> make_part_halos(const Graph& graph, const std::vector<int>& part_of,
                                      int parts);

}  // namespace phyxel
