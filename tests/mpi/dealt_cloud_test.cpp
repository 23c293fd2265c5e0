/// Clouds that one rank has made, dealt out to all.
#include "mpi/dealt_cloud.hpp"

#include <gtest/gtest.h>

#include <utility>

#include "ranks.hpp"

namespace phyxel {
namespace {

using test::world;

/// A cloud with a value of every kind, none of which repeats.
Cloud full_cloud() {
  Cloud cloud;
  for (int k = 0; k < 23; ++k) {
    cloud.position.push_back({0.1 * k, 1.0 / (k + 1), -2.0 * k});
    cloud.volume.push_back(1e-3 * (k + 1));
    cloud.spacing.push_back(0.5 + k);
    (k % 3 ? cloud.regions["few"] : cloud.regions["many"]).push_back(k);
  }
  cloud.regions["last"] = {22};
  cloud.regions["none"] = {};
  cloud.surface = {.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                   .normal = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {0, 0, -1}},
                   .triangle = {{0, 1, 2}, {1, 2, 3}},
                   .groups = {{"head", {0}}, {"head, tail", {0, 1}}}};
  cloud.cuts = {.list = {{SpaceRegion{}, SpaceRegion{}}}, .depth = 0.25, .spacing = 3, .shift = 7};
  cloud.cuts.list[0].wall.low = {1, 2, 3};
  cloud.warnings = {"one", "", "another, longer one"};
  return cloud;
}

void expect_same(const CloudPiece& piece, const CloudPiece& expected) {
  const Cloud &a = piece.cloud, &b = expected.cloud;
  EXPECT_EQ(piece.first, expected.first);
  EXPECT_EQ(piece.whole, expected.whole);
  EXPECT_TRUE(a.position == b.position);
  EXPECT_EQ(a.volume, b.volume);
  EXPECT_EQ(a.spacing, b.spacing);
  EXPECT_EQ(a.regions, b.regions);
  EXPECT_TRUE(a.surface.position == b.surface.position);
  EXPECT_TRUE(a.surface.normal == b.surface.normal);
  EXPECT_EQ(a.surface.triangle, b.surface.triangle);
  EXPECT_EQ(a.surface.groups, b.surface.groups);
  EXPECT_EQ(a.lattice, b.lattice);
  EXPECT_EQ(a.cuts.list, b.cuts.list);
  EXPECT_EQ(a.cuts.depth, b.cuts.depth);
  EXPECT_EQ(a.cuts.spacing, b.cuts.spacing);
  EXPECT_EQ(a.cuts.shift, b.cuts.shift);
}

TEST(DealtCloud, PiecesAreThoseOfTheWhole) {
  const int ranks = world().size();
  Cloud few = full_cloud();  // fewer phyxels than ranks, and no volumes
  few.position.resize(1);
  few.volume.clear();
  few.spacing.clear();
  few.regions = {{"end", {0}}};
  few.lattice = true;
  for (const Cloud& whole : {full_cloud(), few, Cloud{}}) {
    for (int maker = 0; maker < ranks; ++maker) {
      DealtCloud dealt(world(), world().rank() == maker ? whole : Cloud{}, maker);
      for (int turn = 0; turn < 2; ++turn) {
        const auto number = [&](int rank) { return (rank + turn) % ranks; };
        const CloudPiece piece = dealt.piece(number);
        expect_same(piece, cut_piece(whole, {number(world().rank()), ranks}));
        EXPECT_EQ(piece.cloud.warnings, turn == 0 ? whole.warnings : std::vector<std::string>{});
      }
    }
  }
}

}  // namespace
}  // namespace phyxel
