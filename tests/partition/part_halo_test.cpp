/// Halos of parts, compared with their definition and in use.
#include "partition/part_halo.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "bodies.hpp"
#include "partition/partition.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

class Halo : public ::testing::TestWithParam<CutCase> {};

TEST_P(Halo, GhostsAndBoundaryAreWhatTheyAreDefinedAs) {
  const Graph graph = phyxel_graph(GetParam().make());
  for (const int parts : {1, 3, 8}) {
    const std::vector<int> part_of = make_partition(graph, parts, Partitioner::bisection);
    for (const PartHalo& plan : make_part_halos(graph, part_of, parts)) {
      std::set<Index> reached;
      for (Index v = 0; v < graph.vertices(); ++v) {
        if (part_of[v] == plan.part) reached.insert(v);
      }
      EXPECT_EQ(plan.owned, std::vector<Index>(reached.begin(), reached.end()));
      std::set<Index> expected;
      for (const Index v : reached) {
        for (const Index w : graph.row(v)) {
          if (!reached.count(w)) expected.insert(w);
        }
      }
      EXPECT_EQ(plan.ghosts, std::vector<Index>(expected.begin(), expected.end()));
      std::vector<Index> boundary;
      for (const Index v : plan.owned) {
        const auto row = graph.row(v);
        if (std::any_of(row.begin(), row.end(), [&](Index w) { return part_of[w] != plan.part; })) {
          boundary.push_back(v);
        }
      }
      EXPECT_EQ(plan.boundary, boundary);
    }
  }
}

TEST_P(Halo, WhatOneSendsTheOtherReceives) {
  const Graph graph = phyxel_graph(GetParam().make());
  constexpr int parts = 6;
  const std::vector<int> part_of = make_partition(graph, parts, Partitioner::curve);
  const std::vector<PartHalo> plans = make_part_halos(graph, part_of, parts);
  const auto peer_of = [](const PartHalo& plan, int part) -> const PartHalo::Peer* {
    for (const PartHalo::Peer& peer : plan.peers) {
      if (peer.part == part) return &peer;
    }
    return nullptr;
  };
  for (const PartHalo& plan : plans) {
    std::vector<Index> received;
    for (const PartHalo::Peer& peer : plan.peers) {
      EXPECT_NE(peer.part, plan.part);
      const PartHalo::Peer* other = peer_of(plans[peer.part], plan.part);
      ASSERT_NE(other, nullptr);
      EXPECT_EQ(peer.receive, other->send);
      for (const Index v : peer.receive) EXPECT_EQ(part_of[v], peer.part);
      received.insert(received.end(), peer.receive.begin(), peer.receive.end());
    }
    std::sort(received.begin(), received.end());
    EXPECT_EQ(received, plan.ghosts);  // every ghost once
  }
}

/// Two successive exchanges, as in a step.
std::vector<std::int64_t> gathered(const Graph& graph, const std::vector<std::int64_t>& values,
                                   const std::vector<Index>& rows) {
  std::vector<std::int64_t> sums(values.size(), -1);
  for (const Index v : rows) {
    sums[v] = 7 * values[v];
    for (const Index w : graph.row(v)) sums[v] += values[w];
  }
  return sums;
}

TEST_P(Halo, EveryPartGetsWhatTheWholeHas) {
  const Graph graph = phyxel_graph(GetParam().make());
  constexpr int parts = 5;
  const std::vector<int> part_of = make_partition(graph, parts, Partitioner::metis);
  const auto n = static_cast<std::size_t>(graph.vertices());
  std::vector<std::int64_t> u(n);
  std::vector<Index> all(n);
  for (std::size_t v = 0; v < n; ++v) {
    u[v] = static_cast<std::int64_t>(v * v % 1009);
    all[v] = static_cast<Index>(v);
  }
  const std::vector<std::int64_t> q = gathered(graph, u, all), f = gathered(graph, q, all);

  constexpr std::int64_t unknown = -1'000'000'000;
  for (const PartHalo& plan : make_part_halos(graph, part_of, parts)) {
    // A part knows its own values and those it receives, no others.
    std::vector<std::int64_t> own_u(n, unknown);
    for (const Index v : plan.owned) own_u[v] = u[v];
    for (const PartHalo::Peer& peer : plan.peers) {
      for (const Index v : peer.receive) own_u[v] = u[v];
    }
    std::vector<std::int64_t> own_q = gathered(graph, own_u, plan.owned);
    for (const PartHalo::Peer& peer : plan.peers) {
      for (const Index v : peer.receive) own_q[v] = q[v];
    }
    const std::vector<std::int64_t> own_f = gathered(graph, own_q, plan.owned);
    for (const Index v : plan.owned) EXPECT_EQ(own_f[v], f[v]);
  }
}

INSTANTIATE_TEST_SUITE_P(Bodies, Halo, ::testing::ValuesIn(cut_cases()),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace phyxel
