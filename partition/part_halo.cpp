#include "partition/part_halo.hpp"

#include <algorithm>
#include <utility>

namespace phyxel {
namespace {

PartHalo::Peer& peer_of(PartHalo& halo, int part) {
  for (PartHalo::Peer& peer : halo.peers) {
    if (peer.part == part) return peer;
  }
  PartHalo::Peer& peer = halo.peers.emplace_back();
  peer.part = part;
  return peer;
}

}  // namespace

std::vector<PartHalo> make_part_halos(const Graph& graph, const std::vector<int>& part_of,
                                      int parts) {
  std::vector<PartHalo> halos(static_cast<std::size_t>(parts));
  for (int p = 0; p < parts; ++p) halos[p].part = p;
  for (Index v = 0; v < graph.vertices(); ++v) {
    PartHalo& halo = halos[part_of[v]];
    halo.owned.push_back(v);
    const auto row = graph.row(v);
    const bool at_boundary =
        std::any_of(row.begin(), row.end(), [&](Index w) { return part_of[w] != part_of[v]; });
    if (at_boundary) halo.boundary.push_back(v);
  }
  // The last part that has listed each vertex as a ghost.
  std::vector<int> seen_by(static_cast<std::size_t>(graph.vertices()), -1);
  for (PartHalo& halo : halos) {
    for (const Index v : halo.boundary) {
      for (const Index w : graph.row(v)) {
        if (part_of[w] == halo.part || std::exchange(seen_by[w], halo.part) == halo.part) continue;
        halo.ghosts.push_back(w);
      }
    }
    std::sort(halo.ghosts.begin(), halo.ghosts.end());
    for (const Index v : halo.ghosts) {
      peer_of(halo, part_of[v]).receive.push_back(v);
      peer_of(halos[part_of[v]], halo.part).send.push_back(v);
    }
  }
  for (PartHalo& halo : halos) {
    std::sort(halo.peers.begin(), halo.peers.end(),
              [](const auto& a, const auto& b) { return a.part < b.part; });
  }
  return halos;
}

}  // namespace phyxel
