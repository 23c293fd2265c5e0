#include "solver/surfel_plan.hpp"

#include <algorithm>
#include <numeric>
#include <unordered_set>

#include "model/space_filling_curve.hpp"
#include "solver/carrier_weights.hpp"
#include "sort_unique.hpp"

namespace phyxel::cuda {
namespace {

int filled_up(int count, int group) { return (count + group - 1) / group * group; }

/// The order of phyxels in sums: that of the whole model, so that sums do not depend on the share.
const std::vector<Index>& order_of(const Model& model, const std::vector<Index>& place) {
  return model.share ? model.share->place : place;
}

/// The carriers of the surfels of one block, which begins at surfel `first`, and the first surfel
/// of the next block. Carriers are in the order of tile slots, so that neighbouring surfels read
/// the same one at the same time.
struct Taken {
  std::vector<Index> phyxels;
  Index next;
};
Taken take_surfels(const Model& model, const std::vector<Index>& place,
                   const std::vector<Index>& order, Index first, Index end) {
  std::unordered_set<Index> phyxels;
  Index next = first;
  for (; next < end && next - first < surfel_block; ++next) {
    const auto row = model.surfels.carriers.row(order[next]);
    const auto fresh =
        std::count_if(row.begin(), row.end(), [&](Index i) { return phyxels.count(i) == 0; });
    if (next > first && phyxels.size() + static_cast<std::size_t>(fresh) > block_slots) break;
    phyxels.insert(row.begin(), row.end());
  }
  std::vector<Index> sorted(phyxels.begin(), phyxels.end());
  const std::vector<Index>& whole = order_of(model, place);
  std::sort(sorted.begin(), sorted.end(), [&](Index a, Index b) { return whole[a] < whole[b]; });
  return {std::move(sorted), next};
}

void add_block(SurfelPlan& plan, const Model& model, const std::vector<Index>& place,
               const CrackSides& sides, Index first, const Taken& taken) {
  const Csr& carriers = model.surfels.carriers;
  const std::vector<Index>& phyxels = taken.phyxels;
  const std::vector<Index>& whole = order_of(model, place);
  SurfelBlock block;
  block.first_surfel = first;
  block.surfels = taken.next - first;
  const auto surfel = [&](int s) { return plan.order[first + s]; };
  for (int s = 0; s < block.surfels; ++s) {
    block.centre += 1.0 / block.surfels * model.surfels.position[surfel(s)];
    block.carriers = std::max(block.carriers, static_cast<int>(carriers.row(surfel(s)).size()));
  }
  block.carriers = filled_up(block.carriers, carrier_group);
  block.slots = static_cast<int>(phyxels.size());
  block.tile = place[phyxels.front()] / tile_size;
  block.first_slot = static_cast<Offset>(plan.place.size());
  for (const Index i : phyxels) {
    plan.place.push_back(place[i]);
    plan.tiles.push_back(place[i] / tile_size);
  }
  plan.most_slots = std::max(plan.most_slots, block.slots);

  block.first_carrier = static_cast<Offset>(plan.carriers.size());
  plan.carriers.resize(plan.carriers.size() +
                       static_cast<std::size_t>(block.carriers) * surfel_block);
  for (int s = 0; s < block.surfels; ++s) {
    const auto row = carriers.row(surfel(s));
    const std::vector<double> weights = carrier_weights(model, surfel(s), sides);
    std::vector<Carrier> own;
    for (std::size_t k = 0; k < row.size(); ++k) {
      const auto at = std::lower_bound(phyxels.begin(), phyxels.end(), row[k],
                                       [&](Index a, Index b) { return whole[a] < whole[b]; });
      own.push_back({weights[k], static_cast<int>(at - phyxels.begin())});
    }
    std::sort(own.begin(), own.end(),
              [](const Carrier& a, const Carrier& b) { return a.slot < b.slot; });
    own.resize(static_cast<std::size_t>(block.carriers), {0, own.front().slot});
    for (std::size_t k = 0; k < own.size(); ++k) {
      plan.carriers[block.first_carrier + k * surfel_block + s] = own[k];
    }
  }
  plan.blocks.push_back(block);
}

}  // namespace

SurfelPlan make_surfel_plan(const Model& model, const std::vector<Index>& place,
                            const CrackSides& sides) {
  const Surfels& surfels = model.surfels;
  // A block takes surfels of one tile, that of their first carrier. The rank that owns the tile has
  // all its surfels, and makes the same blocks as a single rank.
  const auto count = static_cast<Index>(surfels.position.size());
  std::vector<Index> by_tile(static_cast<std::size_t>(count)), tile(by_tile.size());
  std::iota(by_tile.begin(), by_tile.end(), 0);
  for (Index s = 0; s < count; ++s) tile[s] = place[surfels.carriers.row(s).front()] / tile_size;
  std::stable_sort(by_tile.begin(), by_tile.end(),
                   [&](Index a, Index b) { return tile[a] < tile[b]; });

  SurfelPlan plan;
  for (Index begin = 0, end = 0; begin < count; begin = end) {
    std::vector<Vec3d> position;
    for (; end < count && tile[by_tile[end]] == tile[by_tile[begin]]; ++end) {
      position.push_back(surfels.position[by_tile[end]]);
    }
    for (const Index k : curve_order(position, 0, end - begin)) {
      plan.order.push_back(by_tile[begin + k]);
    }
    for (Index first = begin; first < end;) {
      const Taken taken = take_surfels(model, place, plan.order, first, end);
      add_block(plan, model, place, sides, first, taken);
      first = taken.next;
    }
  }
  sort_unique(plan.tiles);
  return plan;
}

}  // namespace phyxel::cuda
