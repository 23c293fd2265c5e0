#include "solver/surfel_plan.hpp"

#include <algorithm>
#include <unordered_set>

#include "model/space_filling_curve.hpp"
#include "solver/carrier_weights.hpp"
#include "sort_unique.hpp"

namespace phyxel::cuda {
namespace {

int filled_up(int count, int group) { return (count + group - 1) / group * group; }

/// The places of the phyxels that carry the surfels from `first` on, as many of these as a block
/// takes, ascending, so that surfels side by side name the same one at the same time; and where the
/// next block begins.
struct Taken {
  std::vector<Index> places;
  Index next;
};
Taken take_surfels(const Model& model, const std::vector<Index>& place,
                   const std::vector<Index>& order, Index first, Index end) {
  std::unordered_set<Index> places;
  Index next = first;
  for (; next < end && next - first < surfel_block; ++next) {
    const auto row = model.surfels.carriers.row(order[next]);
    const auto fresh =
        std::count_if(row.begin(), row.end(), [&](Index i) { return places.count(place[i]) == 0; });
    if (next > first && places.size() + static_cast<std::size_t>(fresh) > block_slots) break;
    for (const Index i : row) places.insert(place[i]);
  }
  std::vector<Index> ascending(places.begin(), places.end());
  std::sort(ascending.begin(), ascending.end());
  return {std::move(ascending), next};
}

void add_block(SurfelPlan& plan, const Model& model, const std::vector<Index>& place, Index first,
               const Taken& taken) {
  const Csr& carriers = model.surfels.carriers;
  const std::vector<Index>& places = taken.places;
  SurfelBlock block;
  block.first_surfel = first;
  block.surfels = taken.next - first;
  const auto surfel = [&](int s) { return plan.order[first + s]; };
  for (int s = 0; s < block.surfels; ++s) {
    block.centre += 1.0 / block.surfels * model.surfels.position[surfel(s)];
    block.carriers = std::max(block.carriers, static_cast<int>(carriers.row(surfel(s)).size()));
  }
  block.carriers = filled_up(block.carriers, carrier_group);
  block.slots = static_cast<int>(places.size());
  block.tile = places.front() / tile_size;
  block.first_slot = static_cast<Offset>(plan.place.size());
  plan.place.insert(plan.place.end(), places.begin(), places.end());
  plan.most_slots = std::max(plan.most_slots, block.slots);
  for (const Index p : places) plan.tiles.push_back(p / tile_size);

  block.first_carrier = static_cast<Offset>(plan.carriers.size());
  plan.carriers.resize(plan.carriers.size() +
                       static_cast<std::size_t>(block.carriers) * surfel_block);
  for (int s = 0; s < block.surfels; ++s) {
    const auto row = carriers.row(surfel(s));
    const std::vector<double> weights = carrier_weights(model, surfel(s));
    std::vector<Carrier> own;
    for (std::size_t k = 0; k < row.size(); ++k) {
      const auto at = std::lower_bound(places.begin(), places.end(), place[row[k]]);
      own.push_back({weights[k], static_cast<int>(at - places.begin())});
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

SurfelPlan make_surfel_plan(const Model& model, const std::vector<Index>& place) {
  SurfelPlan plan;
  for (const Part& part : model.parts) {
    if (part.surfel_begin == part.surfel_end) continue;
    const std::vector<Index> order =
        curve_order(model.surfels.position, part.surfel_begin, part.surfel_end);
    plan.order.insert(plan.order.end(), order.begin(), order.end());
    for (Index first = part.surfel_begin; first < part.surfel_end;) {
      const Taken taken = take_surfels(model, place, plan.order, first, part.surfel_end);
      add_block(plan, model, place, first, taken);
      first = taken.next;
    }
  }
  sort_unique(plan.tiles);
  return plan;
}

}  // namespace phyxel::cuda
