/// The halo of each part of a graph: its ghosts, and its send and receive lists.
#pragma once

#include <vector>

#include "partition/graph.hpp"

namespace phyxel {

/// The halo of one part. Lists are vertices of the whole graph, ascending.
struct PartHalo {
  int part = 0;
  std::vector<Index> owned;
  std::vector<Index> boundary;  ///< Owned vertices with a neighbour of another part.
  std::vector<Index> ghosts;    ///< Neighbours of owned vertices that other parts own.
  /// The vertices that this part and another one exchange.
  struct Peer {
    int part = 0;
    std::vector<Index> send, receive;
  };
  std::vector<Peer> peers;  ///< Parts to send to or receive from, ascending.
};

/// Builds the halos of all parts.
std::vector<PartHalo> make_part_halos(const Graph& graph, const std::vector<int>& part_of,
                                      int parts);

}  // namespace phyxel
