/// Partitions: complete, of equal weight, with few ghosts.
#include "partition/partition.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "bodies.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

const std::vector<Partitioner> all_partitioners = {Partitioner::metis, Partitioner::curve,
                                                   Partitioner::bisection};

class Cut : public ::testing::TestWithParam<CutCase> {};

TEST_P(Cut, GraphHasTheNeighboursOfEitherPass) {
  const Model model = GetParam().make();
  const Graph graph = phyxel_graph(model);
  ASSERT_EQ(graph.vertices(), model.size());
  const auto& support = model.neighbourhood.support;
  for (Index i = 0; i < model.size(); i += 37) {
    std::vector<Index> expected;
    Index part = 0;
    while (i >= model.parts[part].end) ++part;
    for (Index j = model.parts[part].begin; j < model.parts[part].end; ++j) {
      const double d = norm(model.position[j] - model.position[i]);
      if (j != i && d < std::max(support[i], support[j])) expected.push_back(j);
    }
    const auto row = graph.row(i);
    EXPECT_EQ(std::vector<Index>(row.begin(), row.end()), expected) << i;
  }
}

TEST_P(Cut, PartsAreCompleteEqualAndTheSameAgain) {
  const Graph graph = phyxel_graph(GetParam().make());
  const Index n = graph.vertices();
  const std::int64_t heaviest =
      *std::max_element(graph.vertex_weight.begin(), graph.vertex_weight.end());
  for (const Partitioner partitioner : all_partitioners) {
    for (const int parts : {1, 2, 3, 5, 8, 13}) {
      const std::vector<int> part_of = make_partition(graph, parts, partitioner);
      ASSERT_EQ(static_cast<Index>(part_of.size()), n);
      std::map<int, std::int64_t> weight;
      for (Index v = 0; v < n; ++v) {
        ASSERT_GE(part_of[v], 0);
        ASSERT_LT(part_of[v], parts);
        weight[part_of[v]] += graph.vertex_weight[v];
      }
      EXPECT_EQ(weight.size(), static_cast<std::size_t>(std::min<Index>(parts, n)));
      if (n > 10 * parts) {
        // METIS keeps its 1%; the others miss by half a vertex at each of up to four cuts.
        const double mean = static_cast<double>(graph.total_weight()) / parts;
        const double slack = partitioner == Partitioner::metis ? 0.0101 * mean : 0.0;
        for (const auto& [part, w] : weight) {
          EXPECT_LT(static_cast<double>(w), mean + slack + 2.0 * static_cast<double>(heaviest))
              << partitioner_name(partitioner) << ' ' << parts;
        }
      }
      EXPECT_EQ(make_partition(graph, parts, partitioner), part_of);
    }
  }
}

TEST_P(Cut, QualityIsWhatItSays) {
  const Graph graph = phyxel_graph(GetParam().make());
  for (const Partitioner partitioner : all_partitioners) {
    constexpr int parts = 4;
    const std::vector<int> part_of = make_partition(graph, parts, partitioner);
    std::int64_t cut = 0;
    std::set<std::pair<int, Index>> ghosts;
    std::set<std::pair<int, int>> peers;
    for (Index v = 0; v < graph.vertices(); ++v) {
      for (const Index w : graph.row(v)) {
        if (part_of[v] == part_of[w]) continue;
        cut += v < w;
        ghosts.emplace(part_of[v], w);
        peers.emplace(part_of[v], part_of[w]);
      }
    }
    const PartitionQuality q = quality_of(graph, part_of, parts);
    EXPECT_EQ(q.cut, cut);
    EXPECT_EQ(q.ghosts, static_cast<std::int64_t>(ghosts.size()));
    std::ptrdiff_t most_ghosts = 0, most_peers = 0;
    for (int p = 0; p < parts; ++p) {
      const auto of_part = [p](const auto& entry) { return entry.first == p; };
      most_ghosts = std::max(most_ghosts, std::count_if(ghosts.begin(), ghosts.end(), of_part));
      most_peers = std::max(most_peers, std::count_if(peers.begin(), peers.end(), of_part));
    }
    EXPECT_EQ(q.most_ghosts, most_ghosts);
    EXPECT_EQ(q.most_peers, most_peers);
    EXPECT_EQ(q.empty, 0);
  }
}

TEST_P(Cut, GroupsKeepTheWeights) {
  const Model model = GetParam().make();
  const Graph graph = phyxel_graph(model);
  const Groups groups = curve_groups(model, 16);
  const Graph coarse = grouped_graph(graph, groups);
  ASSERT_EQ(coarse.vertices(), groups.count);
  EXPECT_EQ(coarse.total_weight(), graph.total_weight());
  std::map<std::pair<Index, Index>, std::int64_t> expected, found;
  for (Index v = 0; v < graph.vertices(); ++v) {
    for (const Index w : graph.row(v)) {
      if (groups.of[v] != groups.of[w]) ++expected[{groups.of[v], groups.of[w]}];
    }
  }
  for (Index g = 0; g < coarse.vertices(); ++g) {
    for (Offset e = coarse.offsets[g]; e < coarse.offsets[g + 1]; ++e) {
      found[{g, coarse.neighbours[e]}] = coarse.edge_weight[e];
    }
  }
  EXPECT_EQ(found, expected);
  std::map<Index, std::set<std::size_t>> bodies;  // none reaches over two
  std::map<Index, int> members;
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    for (Index i = model.parts[p].begin; i < model.parts[p].end; ++i) {
      bodies[groups.of[i]].insert(p);
      EXPECT_LE(++members[groups.of[i]], 16);
    }
  }
  for (const auto& [group, of_group] : bodies) EXPECT_EQ(of_group.size(), 1U) << group;
}

INSTANTIATE_TEST_SUITE_P(Bodies, Cut, ::testing::ValuesIn(cut_cases()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(Partition, FewerVerticesThanPartsStandAlone) {
  const Graph graph = phyxel_graph(tiny());
  for (const Partitioner partitioner : all_partitioners) {
    for (const int parts : {5, 6, 9}) {
      const std::vector<int> part_of = make_partition(graph, parts, partitioner);
      EXPECT_EQ(std::set<int>(part_of.begin(), part_of.end()).size(), 5U);
      EXPECT_EQ(quality_of(graph, part_of, parts).empty, parts - 5);
    }
    EXPECT_TRUE(make_partition(Graph{}, 3, partitioner).empty());
    EXPECT_THROW(make_partition(graph, 0, partitioner), InputError);
  }
}

TEST(Partition, BisectionOfARegularCubeIntoEightGivesOctants) {
  const Graph graph = phyxel_graph(model_of(one_body(), lattice(8, 8, 8, 1.0)));
  // Phyxels at the surface have fewer neighbours; the halves of a symmetric body weigh the same.
  const std::vector<int> part_of = make_partition(graph, 8, Partitioner::bisection);
  std::map<int, std::set<int>> octants;
  for (Index v = 0; v < graph.vertices(); ++v) {
    const Vec3d x = graph.centre[v];
    octants[part_of[v]].insert((x.x > 4) + 2 * (x.y > 4) + 4 * (x.z > 4));
  }
  for (const auto& [part, within] : octants) EXPECT_EQ(within.size(), 1U) << part;
}

TEST(Partition, MetisFollowsTheWireOfACoil) {
  // 16 parts of a wire have 15 cuts; planes through four turns have more.
  const Graph graph = phyxel_graph(coil());
  const auto ghosts = [&](Partitioner partitioner) {
    return quality_of(graph, make_partition(graph, 16, partitioner), 16).ghosts;
  };
  EXPECT_LT(ghosts(Partitioner::metis), ghosts(Partitioner::bisection));
  EXPECT_LT(ghosts(Partitioner::metis), ghosts(Partitioner::curve));
}

TEST(Partition, TheChosenOneHasTheLeastSlowPart) {
  for (const Model& model : {coil(), cube()}) {
    const Graph graph = phyxel_graph(model);
    const Groups groups = curve_groups(model, 32);
    for (const Groups* whole : {static_cast<const Groups*>(nullptr), &groups}) {
      const ChosenPartition chosen = choose_partition(graph, whole, 5, all_partitioners);
      EXPECT_EQ(chosen.quality.slowest, quality_of(graph, chosen.part_of, 5).slowest);
      EXPECT_GT(chosen.quality.slowest, 1);  // somebody has the mean, and ghosts
      for (const Partitioner each : all_partitioners) {
        EXPECT_LE(chosen.quality.slowest,
                  choose_partition(graph, whole, 5, {each}).quality.slowest);
      }
      if (!whole) continue;
      std::vector<int> part_of_group(static_cast<std::size_t>(groups.count), -1);
      for (Index v = 0; v < graph.vertices(); ++v) {
        int& part = part_of_group[groups.of[v]];
        if (part < 0) part = chosen.part_of[v];
        ASSERT_EQ(part, chosen.part_of[v]);
      }
    }
  }
  // METIS follows a wire, whose pieces have the fewest ghosts.
  EXPECT_EQ(choose_partition(phyxel_graph(coil()), nullptr, 16, all_partitioners).partitioner,
            Partitioner::metis);
}

TEST(Partition, HeavyVerticesAreSharedOut) {
  Graph graph = phyxel_graph(cube());
  for (Index v = 0; v < graph.vertices() / 4; ++v) graph.vertex_weight[v] *= 40;
  for (const Partitioner partitioner : all_partitioners) {
    EXPECT_LT(quality_of(graph, make_partition(graph, 6, partitioner), 6).imbalance, 0.2)
        << partitioner_name(partitioner);
  }
}

TEST(Partition, WeightsBeyondMetissIntegersAreScaled) {
  Graph graph = phyxel_graph(cube());
  for (std::int64_t& w : graph.vertex_weight) w *= 1'000'000'000;
  graph.edge_weight.assign(graph.neighbours.size(), 3'000'000'000);
  EXPECT_LT(quality_of(graph, make_partition(graph, 4, Partitioner::metis), 4).imbalance, 0.011);
}

TEST(Partition, NamesAreKnown) {
  for (const std::string& name : partitioner_names()) {
    EXPECT_EQ(partitioner_name(partitioner_of(name)), name);
  }
  EXPECT_THROW(partitioner_of("metiss"), InputError);
}

}  // namespace
}  // namespace phyxel
