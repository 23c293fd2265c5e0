/// Blocks of surfels: every surfel once, with its own carriers.
#include "solver/surfel_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "partition/partition.hpp"
#include "partition/share.hpp"
#include "solver/carrier_weights.hpp"
#include "support/clouds.hpp"

namespace phyxel::cuda {
namespace {

using namespace phyxel::testing;

/// Two bodies, the second in between two tiles' sizes, supports of each phyxel's own.
Model two_bodies() {
  return built_in_bodies("horn_bug", "alien_head", NeighbourhoodRule::Support::adaptive);
}

/// A mesh so coarse that its vertices share no carriers.
Model coarse_mesh() {
  Scene scene = one_body();
  BodyRequest& body = scene.bodies[0];
  body.source.shape = {.name = "block", .size = {2.4, 2.4, 2.4}, .spacing = 0.1, .surface = true};
  body.neighbourhood.factor = 2;
  Cloud cloud = make_cloud(body);
  Surface sparse;
  for (std::size_t s = 0; s < cloud.surface.position.size(); s += 9) {
    sparse.position.push_back(cloud.surface.position[s]);
    sparse.normal.push_back(cloud.surface.normal[s]);
  }
  for (Index s = 0; s + 2 < static_cast<Index>(sparse.position.size()); s += 3) {
    sparse.triangle.push_back({s, s + 1, s + 2});
  }
  cloud.surface = sparse;
  return build_model(scene, std::vector<Cloud>{cloud});
}

class SurfelPlans : public ::testing::TestWithParam<Model (*)()> {};

TEST_P(SurfelPlans, HaveEverySurfelOnceWithItsCarriers) {
  const Model model = GetParam()();
  const Tiling tiling = make_tiling(model);
  const SurfelPlan plan = make_surfel_plan(model, tiling.place);
  const auto count = model.surfels.position.size();
  ASSERT_EQ(plan.order.size(), count);
  std::vector<char> seen(count, 0);
  int next = 0;
  EXPECT_LE(plan.most_slots, block_slots);
  for (const SurfelBlock& block : plan.blocks) {
    EXPECT_EQ(block.first_surfel, next);
    next += block.surfels;
    EXPECT_EQ(block.carriers % carrier_group, 0);
    for (int slot = 0; slot < block.slots; ++slot) {
      const Index place = plan.place[block.first_slot + slot];
      if (slot > 0) {  // nobody twice
        EXPECT_GT(place, plan.place[block.first_slot + slot - 1]);
      }
      EXPECT_TRUE(std::binary_search(plan.tiles.begin(), plan.tiles.end(), place / tile_size));
    }
    for (int s = 0; s < block.surfels; ++s) {
      const Index surfel = plan.order[block.first_surfel + s];
      EXPECT_EQ(seen[surfel]++, 0);
      std::map<Index, double> expected, found;
      const auto row = model.surfels.carriers.row(surfel);
      const std::vector<double> weights = carrier_weights(model, surfel);
      for (std::size_t k = 0; k < row.size(); ++k) expected[row[k]] = weights[k];
      for (int k = 0; k < block.carriers; ++k) {
        const Carrier& carrier = plan.carriers[block.first_carrier + k * surfel_block + s];
        ASSERT_LT(carrier.slot, block.slots);
        if (carrier.weight == 0) continue;
        found[tiling.phyxel[plan.place[block.first_slot + carrier.slot]]] = carrier.weight;
      }
      EXPECT_EQ(found, expected);
    }
  }
  EXPECT_EQ(next, static_cast<int>(count));
}

/// All that the sums of a block's surfels depend on, in terms of the whole model.
struct Described {
  Vec3d centre;
  std::vector<Index> surfels;
  std::vector<std::pair<Index, double>> carriers;  ///< Of one surfel after the other.
  bool operator==(const Described&) const = default;
};
/// By first surfel.
std::map<Index, Described> described(const Model& model, const Tiling& tiling) {
  const SurfelPlan plan = make_surfel_plan(model, tiling.place);
  std::map<Index, Described> blocks;
  for (const SurfelBlock& block : plan.blocks) {
    Described d{block.centre, {}, {}};
    for (int s = 0; s < block.surfels; ++s) {
      const Index surfel = plan.order[block.first_surfel + s];
      d.surfels.push_back(model.share ? model.share->global_surfel_id[surfel] : surfel);
      for (int k = 0; k < block.carriers; ++k) {
        const Carrier& c = plan.carriers[block.first_carrier + k * surfel_block + s];
        const Index place = plan.place[block.first_slot + c.slot];
        d.carriers.emplace_back(model.global_id(tiling.phyxel[place]), c.weight);
      }
    }
    EXPECT_TRUE(blocks.emplace(d.surfels.front(), d).second);
  }
  return blocks;
}

TEST_P(SurfelPlans, OfSharesHaveTheBlocksOfTheWhole) {
  const Model whole = GetParam()();
  const auto expected = described(whole, make_tiling(whole));
  const Graph graph = phyxel_graph(whole);
  const Groups tiles = curve_groups(whole, tile_size);
  for (const int parts : {2, 3}) {
    std::vector<int> part_of_tile;
    for (Index t = 0; t < tiles.count; ++t) part_of_tile.push_back((5 * t + 1) % parts);
    const std::vector<int> part_of = ungrouped(part_of_tile, tiles);
    std::map<Index, Described> found;
    for (const PartHalo& plan : make_part_halos(graph, part_of, parts)) {
      ModelShare made = share_of(whole, plan, part_of);
      made.share.place = values_of(made.share, make_tiling(whole).place);
      made.model.share = std::make_shared<Share>(made.share);
      found.merge(described(made.model, make_tiling(made.model)));
    }
    ASSERT_EQ(found.size(), expected.size());
    for (const auto& [first, block] : expected) EXPECT_TRUE(found.at(first) == block) << first;
  }
}

INSTANTIATE_TEST_SUITE_P(Bodies, SurfelPlans, ::testing::Values(two_bodies, coarse_mesh),
                         [](const auto& test) { return test.index == 0 ? "Dense" : "Coarse"; });

}  // namespace
}  // namespace phyxel::cuda
