/// The layout for a GPU: each phyxel has one place, lists are complete, no bank conflicts.
#include "setup/tiling.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <map>

#include "model/space_filling_curve.hpp"
#include "partition/partition.hpp"
#include "partition/share.hpp"
#include "phyxel/error.hpp"
#include "solver/resident_plan.hpp"
#include "support/clouds.hpp"

namespace phyxel::cuda {
namespace {

using namespace phyxel::testing;

TEST(HilbertCurve, StepsFromCellToCell) {
  // All 16³ cells of a coarse grid, each the first fine cell of its cube: successive cells on the
  // curve share a face, unlike in other orders by bits.
  constexpr int cells = 16, shift = hilbert_bits - 4;
  std::vector<std::pair<std::uint64_t, std::array<int, 3>>> order;
  for (int x = 0; x < cells; ++x) {
    for (int y = 0; y < cells; ++y) {
      for (int z = 0; z < cells; ++z) {
        const std::uint64_t key = hilbert_key(static_cast<std::uint32_t>(x) << shift,
                                              static_cast<std::uint32_t>(y) << shift,
                                              static_cast<std::uint32_t>(z) << shift);
        order.push_back({key >> (3 * shift), {x, y, z}});
      }
    }
  }
  std::sort(order.begin(), order.end());
  for (std::size_t k = 0; k < order.size(); ++k) EXPECT_EQ(order[k].first, k);
  for (std::size_t k = 1; k < order.size(); ++k) {
    int apart = 0;
    for (int a = 0; a < 3; ++a) apart += std::abs(order[k].second[a] - order[k - 1].second[a]);
    ASSERT_EQ(apart, 1) << k;
  }
}

struct Case {
  const char* name;
  Model (*make)();
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

Model jittered() { return model_of(one_body(), lattice(11, 13, 9, 0.1, 0.2)); }
Model single() {
  Cloud cloud;
  cloud.position = {{1, 2, 3}};
  cloud.volume = {1};
  return model_of(one_body(), cloud);
}
Model thread() { return model_of(one_body(), lattice(700, 1, 1, 0.1, 0.05)); }
Model adaptive() {
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  scene.bodies[0].neighbourhood.max_neighbours = 20;
  return model_of(scene, lattice(9, 8, 10, 0.1, 0.3));
}
Model two_bodies() {
  Scene scene = one_body();
  scene.bodies.push_back(scene.bodies[0]);
  const std::vector<Cloud> clouds{lattice(7, 7, 7, 0.1, 0.1), lattice(5, 9, 8, 0.1, 0.2)};
  return build_model(scene, clouds);
}

/// A body of three materials and, too far off to be its neighbour, another.
Model inclusions() {
  Scene scene = one_body();
  scene.bodies.push_back(scene.bodies[0]);
  scene.bodies[0].inclusions = {
      {.select = {.ball = Selection::Ball{{0.5, 0.4, 0.3}, 0.3}}, .material = rubber()},
      {.select = {.box = Selection::Box{{0.9, -1, -1}, {3, 3, 3}}}, .material = rubber()}};
  const std::vector<Cloud> clouds{lattice(12, 9, 8, 0.1, 0.2), lattice(5, 6, 7, 0.1, 0.2)};
  return build_model(scene, clouds);
}

class Tiling : public ::testing::TestWithParam<Case> {};
class ResidentSlices : public Tiling {};

TEST_P(Tiling, PlacesEveryPhyxelOnce) {
  const Model model = GetParam().make();
  const cuda::Tiling tiling = make_tiling(model);
  ASSERT_EQ(tiling.places(), tiling.tiles() * tile_size);
  std::vector<int> seen(static_cast<std::size_t>(model.size()), 0);
  for (Index place = 0; place < tiling.places(); ++place) {
    const Index i = tiling.phyxel[place];
    if (i < 0) continue;
    ++seen[i];
    EXPECT_EQ(tiling.place[i], place);
    const Part& part = model.parts[tiling.part[place / tile_size]];
    EXPECT_TRUE(i >= part.begin && i < part.end);  // a tile has phyxels of one body
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 1), model.size());
}

/// The entries of a lane's list.
std::vector<int> slots_at(const TileLists& lists, Index place) {
  const TileLists::Row row = lists.rows[place / warp_size];
  std::vector<int> slots;
  for (int e = 0; e < row.length; ++e) {
    const std::size_t at =
        (static_cast<std::size_t>(row.chunk + e / chunk) * warp_size + place % warp_size) * chunk +
        e % chunk;
    EXPECT_EQ(lists.entries[at] % 16, 0);
    slots.push_back(lists.entries[at] / 16);
  }
  return slots;
}

void expect_complete(const cuda::Tiling& tiling, const TileLists& lists, const Csr& expected) {
  for (Index place = 0; place < tiling.places(); ++place) {
    const Index tile = place / tile_size;
    std::vector<Index> neighbours;
    for (const int slot : slots_at(lists, place)) {
      if (slot >= tile_size && slot < tile_size + far_slots) continue;
      const Index other = slot < tile_size
                              ? tile * tile_size + slot
                              : lists.halo[static_cast<std::size_t>(tile) * lists.halo_stride +
                                           slot - tile_size - far_slots];
      ASSERT_GE(other, 0);
      neighbours.push_back(tiling.phyxel[other]);
    }
    std::sort(neighbours.begin(), neighbours.end());
    const Index i = tiling.phyxel[place];
    if (i < 0) {
      EXPECT_TRUE(neighbours.empty());
    } else {
      const auto row = expected.row(i);
      EXPECT_TRUE(std::equal(row.begin(), row.end(), neighbours.begin(), neighbours.end())) << i;
    }
  }
}

TEST_P(Tiling, ListsHoldEveryNeighbourOnce) {
  const Model model = GetParam().make();
  const cuda::Tiling tiling = make_tiling(model);
  expect_complete(tiling, tiling.neighbours, model.neighbourhood.neighbours);
  EXPECT_EQ(tiling.inverse.rows.empty(), model.neighbourhood.symmetric);
  expect_complete(tiling, tiling.second(), model.neighbourhood.inverse());
}

TEST_P(Tiling, OfAShareIsThatOfTheWholeTileByTile) {
  const Model whole = GetParam().make();
  const cuda::Tiling expected = make_tiling(whole);
  const std::vector<Index> places = make_tiling(whole).place;
  const Graph graph = phyxel_graph(whole);
  const Groups groups = curve_groups(whole, tile_size);
  for (const int parts : {1, 2, 5}) {
    std::vector<int> part_of_tile;
    for (Index g = 0; g < groups.count; ++g) part_of_tile.push_back((7 * g + 3) % parts);
    const std::vector<int> part_of = ungrouped(part_of_tile, groups);
    Index own = 0;
    for (const PartHalo& plan : make_part_halos(graph, part_of, parts)) {
      ModelShare made = share_of(whole, plan, part_of);
      made.share.place = values_of(made.share, places);
      Model& model = made.model;
      model.share = std::make_shared<Share>(made.share);
      const cuda::Tiling tiling = make_tiling(model);
      own += tiling.own_tiles;
      const auto number = [&](Index place) {
        return tiling.phyxel[place] < 0 ? -1 : model.global_id(tiling.phyxel[place]);
      };
      for (Index i = 0; i < model.size(); ++i) ASSERT_EQ(tiling.phyxel[tiling.place[i]], i);
      for (Index tile = 0; tile < tiling.own_tiles; ++tile) {
        const Index first = tile * tile_size;
        const auto somebody =
            *std::find_if(tiling.phyxel.begin() + first, tiling.phyxel.begin() + first + tile_size,
                          [](Index i) { return i >= 0; });
        const Index other = places[model.global_id(somebody)] / tile_size;
        EXPECT_EQ(tiling.part[tile], expected.part[other]);
        for (Index lane = 0; lane < tile_size; ++lane) {
          ASSERT_EQ(number(first + lane), expected.phyxel[other * tile_size + lane]);
          ASSERT_EQ(slots_at(tiling.neighbours, first + lane),
                    slots_at(expected.neighbours, other * tile_size + lane));
          ASSERT_EQ(slots_at(tiling.second(), first + lane),
                    slots_at(expected.second(), other * tile_size + lane));
        }
        const auto halo = [&](const TileLists& lists, Index of) {
          std::vector<Index> there;
          for (int h = 0; h < lists.halo_stride; ++h) {
            const Index place = lists.halo[static_cast<std::size_t>(of) * lists.halo_stride + h];
            if (place >= 0) there.push_back(place);
          }
          return there;
        };
        const auto is_ghost = [&](Index place) { return place >= tiling.own_tiles * tile_size; };
        const std::vector<Index> near = halo(tiling.neighbours, tile),
                                 inverse = halo(tiling.second(), tile);
        EXPECT_EQ(std::any_of(near.begin(), near.end(), is_ghost) ||
                      std::any_of(inverse.begin(), inverse.end(), is_ghost),
                  tile < tiling.boundary_tiles);
        std::vector<Index> here;
        for (const Index place : halo(tiling.second(), tile)) here.push_back(places[number(place)]);
        EXPECT_EQ(here, halo(expected.second(), other));
      }
    }
    EXPECT_EQ(own, expected.own_tiles);
  }
}

TEST_P(Tiling, EightLanesNeverWaitForAColumn) {
  const Model model = GetParam().make();
  const cuda::Tiling tiling = make_tiling(model);
  for (Index first = 0; first < tiling.places(); first += 8) {
    std::vector<std::vector<int>> slots;
    for (int lane = 0; lane < 8; ++lane) slots.push_back(slots_at(tiling.neighbours, first + lane));
    for (std::size_t step = 0; step < slots[0].size(); ++step) {
      std::map<int, int> in_column;
      for (const auto& list : slots) {
        const auto [at, fresh] = in_column.emplace(list[step] % 8, list[step]);
        ASSERT_TRUE(fresh || at->second == list[step]);
      }
    }
  }
}

/// Slices of a tile visit the same neighbours in the same order, in slots of the same columns.
TEST_P(ResidentSlices, KeepTheOrderOfTheirTile) {
  const Model model = GetParam().make();
  const cuda::Tiling tiling = make_tiling(model);
  const ResidentPlan plan = make_resident_plan(tiling);
  Index seen = 0;
  for (const Slice& slice : plan.slices) {
    const Index tile = slice.first_place / tile_size;
    EXPECT_EQ(slice.slots % 8, 0);
    EXPECT_LE(slice.slots, plan.most_slots);
    const auto place_in = [&](int slot) { return plan.place[slice.first_slot + slot]; };
    for (int p = 0; p < slice_size; ++p) {
      const Index place = slice.first_place + p;
      EXPECT_EQ(place_in(p), tiling.phyxel[place] < 0 ? -1 : place);
      seen += tiling.phyxel[place] >= 0;
      for (int pass = 0; pass < 2; ++pass) {
        const TileLists& lists = pass == 0 ? tiling.neighbours : tiling.second();
        const std::vector<int> slots = slots_at(lists, place);
        const Slice::Rows& rows = slice.rows[pass];
        ASSERT_EQ(rows.length[p / warp_size], static_cast<int>(slots.size()));
        EXPECT_LE(rows.longest, plan.longest[pass]);
        EXPECT_EQ(rows.longest % pair_group, 0);
        for (int e = 0; e < rows.longest; ++e) {
          const std::uint16_t entry = plan.entries[rows.first_entry + e * slice_size + p];
          const Index expected =
              e < rows.length[p / warp_size] ? lists.place_in(tile, slots[e]) : -1;
          if (expected < 0) {
            EXPECT_EQ(entry, far_entry | p);
          } else {
            EXPECT_EQ(place_in(entry), expected);
            EXPECT_EQ(entry % 8, slots[e] % 8);
          }
        }
      }
    }
  }
  EXPECT_EQ(seen, model.size());
}

/// Slices that reach each other make a body, whatever their materials; and what a slice sends goes
/// to the slots of its body's slices that have those phyxels.
TEST_P(ResidentSlices, ThatReachEachOtherMakeABody) {
  const Model model = GetParam().make();
  const cuda::Tiling tiling = make_tiling(model);
  const ResidentPlan plan = make_resident_plan(tiling);
  std::map<std::pair<Index, int>, const Slice*> of_rank;
  std::map<Index, const Slice*> at;
  int most = 0;
  for (const Slice& slice : plan.slices) {
    EXPECT_TRUE(of_rank.emplace(std::pair{slice.body, slice.rank}, &slice).second);
    at[slice.first_place] = &slice;
    EXPECT_GE(slice.rank, 0);
    EXPECT_TRUE(slice.body >= 0 && slice.body < plan.bodies);
    most = std::max(most, slice.rank + 1);
  }
  EXPECT_EQ(plan.most_slices, most);
  EXPECT_EQ(plan.bodies, static_cast<Index>(model.parts.back().body + 1));
  std::size_t sent = 0, received = 0;
  for (const Slice& slice : plan.slices) {
    const Part& part = model.parts[tiling.part[slice.first_place / tile_size]];
    EXPECT_EQ(slice.body, part.body);
    EXPECT_TRUE(slice.rank == 0 || of_rank.contains({slice.body, slice.rank - 1}));
    for (int slot = slice_size; slot < slice.slots; ++slot) {
      const Index place = plan.place[slice.first_slot + slot];
      if (place < 0) continue;
      ++received;
      EXPECT_EQ(at.at(place - place % slice_size)->body, slice.body);
    }
    for (int k = 0; k < slice.destinations * slice_size; ++k) {
      const std::uint32_t to = plan.destinations[slice.first_destination + k];
      if (to == nobody) continue;
      ++sent;
      const Slice& other = *of_rank.at({slice.body, static_cast<int>(to >> 16)});
      EXPECT_EQ(plan.place[other.first_slot + static_cast<int>(to & 0xFFFF)],
                slice.first_place + k % slice_size);
    }
  }
  EXPECT_EQ(sent, received);
}

TEST_P(Tiling, IsTheSameOnAnyNumberOfThreads) {
  const Model model = GetParam().make();
  omp_set_num_threads(1);
  const cuda::Tiling one = make_tiling(model);
  omp_set_num_threads(3);
  const cuda::Tiling two = make_tiling(model);
  EXPECT_EQ(one.phyxel, two.phyxel);
  EXPECT_EQ(one.neighbours.entries, two.neighbours.entries);
  EXPECT_EQ(one.neighbours.halo, two.neighbours.halo);
}

INSTANTIATE_TEST_SUITE_P(Models, Tiling,
                         ::testing::Values(Case{"Jittered", jittered}, Case{"Single", single},
                                           Case{"Thread", thread}, Case{"Adaptive", adaptive},
                                           Case{"TwoBodies", two_bodies}),
                         [](const auto& test) { return std::string(test.param.name); });
INSTANTIATE_TEST_SUITE_P(Models, ResidentSlices,
                         ::testing::Values(Case{"Jittered", jittered}, Case{"Single", single},
                                           Case{"Thread", thread}, Case{"Adaptive", adaptive},
                                           Case{"TwoBodies", two_bodies},
                                           Case{"Inclusions", inclusions}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(TileLists, AreNotMuchLongerThanTheirNeighbours) {
  // The cost of the order: all lanes of a warp take the steps of the longest list. 15% is the
  // spread of neighbour counts in a warp of a jittered cloud; bank conflicts would add a third.
  const Model model = model_of(one_body(), lattice(24, 24, 24, 0.1, 0.1));
  const cuda::Tiling tiling = make_tiling(model);
  std::int64_t steps = 0;
  for (const TileLists::Row& row : tiling.neighbours.rows) steps += warp_size * row.length;
  EXPECT_LT(static_cast<double>(steps),
            1.15 * static_cast<double>(model.neighbourhood.neighbours.entries()));
}

TEST(TileLists, TooManyNeighboursAreRefused) {
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.radius = 1.2;
  const Model model = model_of(scene, lattice(18, 18, 18, 0.1));
  try {
    make_tiling(model);
    FAIL() << "a halo larger than 16-bit slots was accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("allowed"), std::string::npos);
  }
}

}  // namespace
}  // namespace phyxel::cuda
