/// Communication volume of a step, compared with its definition and with the halos.
#include "partition/exchange_size.hpp"

#include <gtest/gtest.h>

#include <set>
#include <utility>

#include "bodies.hpp"
#include "partition/part_halo.hpp"
#include "partition/partition.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

class Exchange : public ::testing::TestWithParam<CutCase> {};

TEST_P(Exchange, SizesAreThoseOfTheirDefinitions) {
  const Model model = GetParam().make();
  const Graph graph = phyxel_graph(model);
  for (const int parts : {1, 2, 8}) {
    const std::vector<int> part_of = make_partition(graph, parts, Partitioner::bisection);
    std::int64_t sends = 0;
    for (const PartHalo& plan : make_part_halos(graph, part_of, parts)) {
      for (const PartHalo::Peer& peer : plan.peers) {
        sends += static_cast<std::int64_t>(peer.send.size());
      }
    }
    std::int64_t pairs = 0;
    std::set<std::pair<Index, int>> pushed;
    for (Index i = 0; i < model.size(); ++i) {
      for (const Index j : model.neighbourhood.neighbours.row(i)) {
        if (part_of[i] == part_of[j]) continue;
        ++pairs;
        pushed.emplace(j, part_of[i]);
      }
    }
    const ExchangeSize size = exchange_size(model, part_of);
    EXPECT_EQ(size.pair_stresses, 12 * sends);
    EXPECT_EQ(size.pair_forces, 3 * sends + 3 * pairs);
    EXPECT_EQ(size.summed_forces, 3 * sends + 3 * static_cast<std::int64_t>(pushed.size()));
  }
}

INSTANTIATE_TEST_SUITE_P(Bodies, Exchange, ::testing::ValuesIn(cut_cases()),
                         [](const auto& test) { return test.param.name; });

/// Near a cut through a compact body, phyxels have more than three neighbours on the other side on
/// average, so that nine numbers are fewer than three for each neighbour.
TEST(ExchangeSizes, PairStressesAreFewerNumbersThanTheForcesOfEachPair) {
  const Model model = cube();
  const Graph graph = phyxel_graph(model);
  for (const std::string& name : partitioner_names()) {
    const ExchangeSize size = exchange_size(model, make_partition(graph, 4, partitioner_of(name)));
    EXPECT_LT(size.pair_stresses, size.pair_forces) << name;
    EXPECT_LT(size.summed_forces, size.pair_stresses) << name;
  }
}

}  // namespace
}  // namespace phyxel
