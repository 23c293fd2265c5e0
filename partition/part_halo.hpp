/// Who sends what to whom: a plain value, made and checked without ranks.
#pragma once

#include <vector>

#include "partition/graph.hpp"

namespace phyxel {

/// One part's view. All lists name vertices of the whole graph, ascending.
struct PartHalo {
  int part = 0;
  std::vector<Index> owned;
  std::vector<Index> boundary;  ///< Owned ones with a neighbour that is not.
  /// Ghosts: rings[0] are neighbours of owned vertices, rings[1] further neighbours of those.
  std::vector<std::vector<Index>> rings;
  /// What one other part and this one exchange, by ring of the one that receives.
  struct Peer {
    int part = 0;
    std::vector<std::vector<Index>> send, receive;
  };
  std::vector<Peer> peers;  ///< Ascending; those with anything to send or to receive.

  std::size_t ghosts() const;  ///< Of all rings.
};

/// The plans of all parts.
/// @param rings how far a part sees: 1 where each pass has its own exchange, 2 where the second
///   ring's stresses are computed twice instead
std::vector<PartHalo> make_part_halos(const Graph& graph, const std::vector<int>& part_of,
                                      int parts, int rings);

}  // namespace phyxel
