#include "solver/surfel_plan.hpp"

#include <algorithm>
#include <unordered_map>

#include "model/space_filling_curve.hpp"
#include "solver/carrier_weights.hpp"

namespace phyxel::cuda {
namespace {

/// Surfels of a body along Hilbert's curve.
std::vector<Index> curve_order(const Model& model, Index begin, Index end) {
  const std::vector<Vec3d>& position = model.surfels.position;
  Vec3d low = position[begin], high = low;
  for (Index s = begin; s < end; ++s) {
    const Vec3d x = position[s];
    low = {std::min(low.x, x.x), std::min(low.y, x.y), std::min(low.z, x.z)};
    high = {std::max(high.x, x.x), std::max(high.y, x.y), std::max(high.z, x.z)};
  }
  const HilbertFrame frame = HilbertFrame::around(low, high);
  std::vector<std::pair<std::uint64_t, Index>> keys;
  for (Index s = begin; s < end; ++s) keys.emplace_back(frame.key_of(position[s]), s);
  std::sort(keys.begin(), keys.end());
  std::vector<Index> order;
  for (const auto& [key, s] : keys) order.push_back(s);
  return order;
}

/// The slots of one block.
class Slots {
 public:
  std::uint16_t of(Index place) {
    const auto [at, is_new] = slot_.emplace(place, static_cast<int>(place_.size()));
    if (is_new) place_.push_back(place);
    if (place_.size() > most_slots) refuse_halo(static_cast<int>(place_.size()));
    return static_cast<std::uint16_t>(at->second);
  }
  const std::vector<Index>& places() const { return place_; }

 private:
  std::unordered_map<Index, int> slot_;
  std::vector<Index> place_;
};

void add_carriers(SurfelPlan& plan, SurfelBlock& block, const Model& model, const Tiling& tiling,
                  Slots& slots) {
  const Csr& carriers = model.surfels.carriers;
  const auto surfel = [&](int s) { return plan.order[block.first_surfel + s]; };
  std::vector<Index> places;
  for (int s = 0; s < block.surfels; ++s) {
    const auto row = carriers.row(surfel(s));
    block.most_carriers = std::max(block.most_carriers, static_cast<int>(row.size()));
    for (const Index i : row) places.push_back(tiling.place[i]);
  }
  // Ascending, so that surfels side by side name the same one at the same time.
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  for (const Index place : places) slots.of(place);
  block.carriers = static_cast<int>(places.size());

  block.first_carrier = static_cast<Offset>(plan.carriers.size());
  const std::size_t size = static_cast<std::size_t>(block.most_carriers) * surfel_block;
  plan.carriers.resize(plan.carriers.size() + size, 0);
  plan.weights.resize(plan.weights.size() + size, 0);
  for (int s = 0; s < block.surfels; ++s) {
    const auto row = carriers.row(surfel(s));
    const std::vector<double> weights = carrier_weights(model, surfel(s));
    std::vector<std::pair<std::uint16_t, double>> entries;
    for (std::size_t k = 0; k < row.size(); ++k) {
      entries.emplace_back(slots.of(tiling.place[row[k]]), weights[k]);
    }
    std::sort(entries.begin(), entries.end());
    for (std::size_t k = 0; k < entries.size(); ++k) {
      const std::size_t at = block.first_carrier + k * surfel_block + s;
      std::tie(plan.carriers[at], plan.weights[at]) = entries[k];
    }
  }
}

void add_neighbours(SurfelPlan& plan, SurfelBlock& block, const Tiling& tiling, Slots& slots) {
  const TileLists& lists = tiling.neighbours;
  for (int c = 0; c < block.carriers; ++c) {
    block.longest = std::max(block.longest, lists.length_of(slots.places()[c]));
  }
  block.longest = (block.longest + list_lanes - 1) / list_lanes * list_lanes;
  block.first_neighbour = static_cast<Offset>(plan.neighbours.size());
  for (int c = 0; c < block.carriers; ++c) {
    const Index place = slots.places()[c];
    for (int e = 0; e < block.longest; ++e) {
      Index neighbour = -1;
      if (e < lists.length_of(place)) {
        neighbour = lists.place_in(place / tile_size, lists.slot_of(place, e));
      }
      plan.neighbours.push_back(slots.of(neighbour < 0 ? place : neighbour));
    }
  }
}

}  // namespace

SurfelPlan make_surfel_plan(const Model& model, const Tiling& tiling) {
  SurfelPlan plan;
  for (const Part& part : model.parts) {
    const Index begin = part.surfel_begin, end = part.surfel_end;
    if (begin == end) continue;
    const std::vector<Index> order = curve_order(model, begin, end);
    plan.order.insert(plan.order.end(), order.begin(), order.end());
    for (Index first = begin; first < end; first += surfel_block) {
      SurfelBlock block;
      block.first_surfel = first;
      block.surfels = std::min<int>(surfel_block, end - first);
      for (int s = 0; s < block.surfels; ++s) {
        block.centre += 1.0 / block.surfels * model.surfels.position[plan.order[first + s]];
      }
      Slots slots;
      add_carriers(plan, block, model, tiling, slots);
      add_neighbours(plan, block, tiling, slots);
      block.tile = slots.places().front() / tile_size;
      block.first_slot = static_cast<Offset>(plan.place.size());
      block.slots = static_cast<int>(slots.places().size());
      plan.place.insert(plan.place.end(), slots.places().begin(), slots.places().end());
      plan.most_slots = std::max(plan.most_slots, block.slots);
      plan.most_block_carriers = std::max(plan.most_block_carriers, block.carriers);
      plan.blocks.push_back(block);
    }
  }
  return plan;
}

}  // namespace phyxel::cuda
