#include "solver/resident_plan.hpp"

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "setup/wait_free.hpp"

namespace phyxel::cuda {
namespace {

/// The image of one slice: the assignment of tile slots to slots of the image.
class Image {
 public:
  /// Assigns the slice's own phyxels first, in the columns of their tile slots.
  Image(const Tiling& tiling, Index first_place) {
    place_.assign(slice_size, -1);
    for (int p = 0; p < slice_size; ++p) {
      if (tiling.phyxel[first_place + p] >= 0) place_[p] = first_place + p;
    }
  }
  /// Returns the slot of a tile slot, which gets the next free one of `column` if it has none.
  std::uint16_t slot_of(Index place, int column) {
    std::size_t slot = static_cast<std::size_t>(column);
    for (; slot < place_.size(); slot += columns) {
      if (place_[slot] == place) return static_cast<std::uint16_t>(slot);
      if (place_[slot] < 0 && slot >= slice_size) break;
    }
    if (slot >= place_.size()) place_.resize((slot / columns + 1) * columns, -1);
    place_[slot] = place;
    return static_cast<std::uint16_t>(slot);
  }
  const std::vector<Index>& places() const { return place_; }

 private:
  std::vector<Index> place_;
};

/// Map from first tile slots to slices.
using SliceAt = std::unordered_map<Index, std::size_t>;

/// Groups slices that reach each other into bodies, and numbers the slices of each.
void find_bodies(const SliceAt& slice_at, ResidentPlan& plan) {
  std::vector<std::size_t> root(plan.slices.size());
  std::iota(root.begin(), root.end(), std::size_t{0});
  const auto root_of = [&](std::size_t s) {
    while (root[s] != s) s = root[s] = root[root[s]];
    return s;
  };
  for (std::size_t s = 0; s < plan.slices.size(); ++s) {
    const Slice& slice = plan.slices[s];
    for (int slot = slice_size; slot < slice.slots; ++slot) {
      const Index place = plan.place[slice.first_slot + slot];
      if (place < 0) continue;
      const std::size_t a = root_of(s), b = root_of(slice_at.at(place - place % slice_size));
      root[std::max(a, b)] = std::min(a, b);  // the first slice of a body is its root
    }
  }
  std::vector<int> slices(plan.slices.size(), 0);  // slices so far of the body of each root
  for (std::size_t s = 0; s < plan.slices.size(); ++s) {
    const std::size_t first = root_of(s);
    plan.slices[s].body = first == s ? plan.bodies++ : plan.slices[first].body;
    plan.slices[s].rank = slices[first]++;
    plan.most_slices = std::max(plan.most_slices, slices[first]);
  }
}

/// Finds the slices that need the phyxels of each slice.
void find_destinations(const SliceAt& slice_at, ResidentPlan& plan) {
  std::vector<std::array<std::vector<std::uint32_t>, slice_size>> of_slice(plan.slices.size());
  for (Slice& slice : plan.slices) {
    for (int slot = slice_size; slot < slice.slots; ++slot) {
      const Index place = plan.place[slice.first_slot + slot];
      if (place < 0) continue;
      ++slice.halo;
      const Index p = place % slice_size;
      of_slice[slice_at.at(place - p)][p].push_back(static_cast<std::uint32_t>(slice.rank) << 16 |
                                                    static_cast<std::uint32_t>(slot));
    }
  }
  for (std::size_t s = 0; s < plan.slices.size(); ++s) {
    Slice& slice = plan.slices[s];
    for (const auto& of_phyxel : of_slice[s]) {
      slice.destinations = std::max(slice.destinations, static_cast<int>(of_phyxel.size()));
    }
    slice.first_destination = static_cast<int>(plan.destinations.size());
    for (int k = 0; k < slice.destinations; ++k) {
      for (const auto& of_phyxel : of_slice[s]) {
        plan.destinations.push_back(k < static_cast<int>(of_phyxel.size()) ? of_phyxel[k] : nobody);
      }
    }
    plan.most_destinations = std::max(plan.most_destinations, slice.destinations);
  }
}

}  // namespace

ResidentPlan make_resident_plan(const Tiling& tiling) {
  ResidentPlan plan;
  const std::array<const TileLists*, 2> lists{&tiling.neighbours, &tiling.second()};
  for (Index first = 0; first < tiling.places(); first += slice_size) {
    // Phyxels stand first in their tile.
    if (tiling.phyxel[first] < 0) continue;
    const Index tile = first / tile_size;
    Image image(tiling, first);
    Slice slice;
    slice.first_place = first;
    for (int pass = 0; pass < 2; ++pass) {
      const TileLists& list = *lists[pass];
      Slice::Rows& rows = slice.rows[pass];
      if (pass == 1 && lists[0] == lists[1]) {
        rows = slice.rows[0];
        continue;
      }
      for (int w = 0; w < slice_warps; ++w) {
        rows.length[w] = list.length_of(first + w * warp_size);
        rows.longest = std::max(rows.longest, rows.length[w]);
      }
      rows.longest = (rows.longest + pair_group - 1) / pair_group * pair_group;
      rows.first_entry = static_cast<int>(plan.entries.size());
      plan.entries.resize(plan.entries.size() +
                          static_cast<std::size_t>(rows.longest) * slice_size);
      for (int p = 0; p < slice_size; ++p) {
        for (int e = 0; e < rows.longest; ++e) {
          std::uint16_t& entry =
              plan.entries[rows.first_entry + static_cast<std::size_t>(e) * slice_size + p];
          entry = static_cast<std::uint16_t>(far_entry | p);
          if (e >= rows.length[p / warp_size]) continue;
          const int slot = list.slot_of(first + p, e);
          const Index place = list.place_in(tile, slot);
          if (place >= 0) entry = image.slot_of(place, slot % columns);
        }
      }
      plan.longest[pass] = std::max(plan.longest[pass], rows.longest);
    }
    if (lists[0] == lists[1]) plan.longest[1] = plan.longest[0];
    slice.slots = static_cast<int>(image.places().size());
    slice.first_slot = static_cast<int>(plan.place.size());
    plan.place.insert(plan.place.end(), image.places().begin(), image.places().end());
    plan.most_slots = std::max(plan.most_slots, slice.slots);
    plan.slices.push_back(slice);
  }
  SliceAt slice_at;
  for (std::size_t s = 0; s < plan.slices.size(); ++s) slice_at[plan.slices[s].first_place] = s;
  find_bodies(slice_at, plan);
  find_destinations(slice_at, plan);
  return plan;
}

}  // namespace phyxel::cuda
