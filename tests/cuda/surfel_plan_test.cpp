/// Blocks of surfels: every surfel once, with its own carriers and their own neighbours.
#include "solver/surfel_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "solver/carrier_weights.hpp"
#include "support/clouds.hpp"

namespace phyxel::cuda {
namespace {

using namespace phyxel::testing;

/// Two bodies, the second in between two tiles' sizes, supports of each phyxel's own.
Model two_bodies() {
  Scene scene;
  for (const char* shape : {"horn_bug", "alien_head"}) {
    BodyRequest body;
    body.name = shape;
    body.where = "test";
    body.source.shape.name = shape;
    body.translation = {shape[0] == 'h' ? 0.0 : 40.0, 0, 0};
    body.material = rubber();
    body.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
    scene.bodies.push_back(body);
  }
  return build_model(scene);
}

TEST(SurfelPlan, HasEverySurfelOnceWithItsCarriers) {
  const Model model = two_bodies();
  const Tiling tiling = make_tiling(model);
  const SurfelPlan plan = make_surfel_plan(model, tiling);
  const auto count = model.surfels.position.size();
  ASSERT_EQ(plan.order.size(), count);
  std::vector<char> seen(count, 0);
  int next = 0;
  for (const SurfelBlock& block : plan.blocks) {
    EXPECT_EQ(block.first_surfel, next);
    next += block.surfels;
    for (int s = 0; s < block.surfels; ++s) {
      const Index surfel = plan.order[block.first_surfel + s];
      EXPECT_EQ(seen[surfel]++, 0);
      std::map<Index, double> expected, found;
      const auto row = model.surfels.carriers.row(surfel);
      const std::vector<double> weights = carrier_weights(model, surfel);
      for (std::size_t k = 0; k < row.size(); ++k) expected[row[k]] = weights[k];
      for (int k = 0; k < block.most_carriers; ++k) {
        const std::size_t at = block.first_carrier + k * surfel_block + s;
        ASSERT_LT(plan.carriers[at], block.carriers);
        if (plan.weights[at] == 0) continue;
        found[tiling.phyxel[plan.place[block.first_slot + plan.carriers[at]]]] = plan.weights[at];
      }
      EXPECT_EQ(found, expected);
    }
  }
  EXPECT_EQ(next, static_cast<int>(count));
}

TEST(SurfelPlan, KnowsTheNeighboursOfCarriers) {
  const Model model = two_bodies();
  const Tiling tiling = make_tiling(model);
  const SurfelPlan plan = make_surfel_plan(model, tiling);
  for (const SurfelBlock& block : plan.blocks) {
    const auto phyxel = [&](int slot) {
      return tiling.phyxel[plan.place[block.first_slot + slot]];
    };
    std::set<Index> all;
    for (int slot = 0; slot < block.slots; ++slot) all.insert(phyxel(slot));
    EXPECT_EQ(static_cast<int>(all.size()), block.slots);  // nobody twice
    EXPECT_EQ(all.count(-1), 0U);
    EXPECT_EQ(block.longest % list_lanes, 0);
    for (int c = 0; c < block.carriers; ++c) {
      std::vector<Index> found;
      for (int e = 0; e < block.longest; ++e) {
        const Index j = phyxel(plan.neighbours[block.first_neighbour + c * block.longest + e]);
        if (j != phyxel(c)) found.push_back(j);
      }
      std::sort(found.begin(), found.end());
      const auto row = model.neighbourhood.neighbours.row(phyxel(c));
      std::vector<Index> expected(row.begin(), row.end());
      std::sort(expected.begin(), expected.end());
      EXPECT_EQ(found, expected);
    }
  }
}

}  // namespace
}  // namespace phyxel::cuda
