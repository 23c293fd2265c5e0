#include "partition/part_halo.hpp"

#include <algorithm>
#include <map>
#include <numeric>

namespace phyxel {
namespace {

/// Vertices next to `from` that the part has not seen, ascending; it has then.
std::vector<Index> next_ring(const Graph& graph, const std::vector<Index>& from, int part,
                             std::vector<int>& seen_by) {
  std::vector<Index> ring;
  for (const Index v : from) {
    for (const Index w : graph.row(v)) {
      if (seen_by[w] == part) continue;
      seen_by[w] = part;
      ring.push_back(w);
    }
  }
  std::sort(ring.begin(), ring.end());
  return ring;
}

PartHalo::Peer& peer_of(PartHalo& plan, int part, std::size_t rings) {
  for (PartHalo::Peer& peer : plan.peers) {
    if (peer.part == part) return peer;
  }
  PartHalo::Peer& peer = plan.peers.emplace_back();
  peer.part = part;
  peer.send.resize(rings);
  peer.receive.resize(rings);
  return peer;
}

}  // namespace

std::size_t PartHalo::ghosts() const {
  return std::accumulate(
      rings.begin(), rings.end(), std::size_t{0},
      [](std::size_t sum, const std::vector<Index>& ring) { return sum + ring.size(); });
}

std::vector<PartHalo> make_part_halos(const Graph& graph, const std::vector<int>& part_of,
                                      int parts, int rings) {
  std::vector<PartHalo> plans(static_cast<std::size_t>(parts));
  for (int p = 0; p < parts; ++p) plans[p].part = p;
  for (Index v = 0; v < graph.vertices(); ++v) {
    PartHalo& plan = plans[part_of[v]];
    plan.owned.push_back(v);
    const auto row = graph.row(v);
    const bool at_boundary =
        std::any_of(row.begin(), row.end(), [&](Index w) { return part_of[w] != part_of[v]; });
    if (at_boundary) plan.boundary.push_back(v);
  }
  std::vector<int> seen_by(static_cast<std::size_t>(graph.vertices()),
                           -1);  // the part that last did
  for (PartHalo& plan : plans) {
    for (const Index v : plan.owned) seen_by[v] = plan.part;
    for (int r = 0; r < rings; ++r) {
      // Only the boundary has neighbours outside.
      plan.rings.push_back(
          next_ring(graph, r == 0 ? plan.boundary : plan.rings.back(), plan.part, seen_by));
      for (const Index v : plan.rings.back()) {
        const auto all = static_cast<std::size_t>(rings);
        peer_of(plan, part_of[v], all).receive[r].push_back(v);
        peer_of(plans[part_of[v]], plan.part, all).send[r].push_back(v);
      }
    }
  }
  for (PartHalo& plan : plans) {
    std::sort(plan.peers.begin(), plan.peers.end(),
              [](const auto& a, const auto& b) { return a.part < b.part; });
  }
  return plans;
}

}  // namespace phyxel
