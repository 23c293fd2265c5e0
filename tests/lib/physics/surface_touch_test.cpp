/// When a point counts as inside a deformed body: in creases of folded limbs, far from all phyxels
/// of a surface, and beside patches that are far from each other at rest.
#include <gtest/gtest.h>

#include <vector>

#include "mesh/distance_field.hpp"
#include "model/assembly.hpp"
#include "phyxel/physics/surface_patches.hpp"
#include "phyxel/solver.hpp"
#include "solver/contact_passes.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

constexpr double range = 0.05;

/// A phyxel of a surface: its place at rest, and where it is now. It is not turned nor stretched.
struct OfSurface {
  Vec3d rest, now;
};

/// A block of 0.2 m, whose distances are exact beside its faces, and a point that is between some
/// phyxels of its surface. They all face the point.
class Touched : public ::testing::Test {
 protected:
  Touched()
      : model_(build_model(parse_scene(
            end +
                "[contact]\n[[body]]\nname = 'a'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\n"
                "spacing = 0.02\n" +
                material +
                "[[body]]\nname = 'b'\nshape = 'block'\nsize = [0.1, 0.1, 0.1]\nspacing = 0.02\n"
                "translation = [1, 0, 0]\n" +
                material,
            "scene.toml"))) {}

  /// The weights and the gap of a point at the origin, with its probe there, too.
  PlaceAtRest found(const std::vector<OfSurface>& surface) const {
    std::vector<SurfaceSite> sites(surface.size());
    std::vector<SurfaceMotion> motions(surface.size());
    for (std::size_t k = 0; k < surface.size(); ++k) {
      sites[k] = {.rest = surface[k].rest, .area = 1e-4, .range = range};
      motions[k].after = motions[k].before = surface[k].now;
      motions[k].range = range;
      motions[k].back = identity<double>();
      motions[k].out = {0, 0, -1};
    }
    SurfaceSite site{.range = range};
    SurfaceMotion point;
    point.range = range;
    point.out = {0, 0, 1};
    const std::vector<Offset> list{
        0, static_cast<Offset>(surface.size()), static_cast<Offset>(surface.size()),
        static_cast<Offset>(surface.size()), static_cast<Offset>(surface.size())};
    return place_at_rest(
        OneThread{}, site, point, list.data(),
        [&](Offset k) -> const SurfaceSite& { return sites[k]; },
        [&](Offset k) -> const SurfaceMotion& { return motions[k]; },
        model_.body_contact.distances[0].view());
  }

  Model model_;
};

TEST_F(Touched, PlacesOnOneFaceHaveOneGap) {
  // The face x = 0.1 is moved to x = -0.01: the point is 1 cm outside.
  const PlaceAtRest near =
      found({{{0.1, 0, 0}, {-0.01, 0, 0}}, {{0.1, 0.02, 0}, {-0.01, 0.02, 0}}});
  EXPECT_NEAR(near.gap.distance, 0.01, 1e-6);
  EXPECT_LE(norm(near.gap.normal - Vec3d{1, 0, 0}), 1e-6);
}

TEST_F(Touched, ThePointInACreaseIsOutsideThoughTheMeanOfItsPlacesIsInside) {
  // The two faces x = ± 0.1, back to back at rest, both 1 cm from the point, outwards.
  const PlaceAtRest fold = found({{{0.1, 0, 0}, {-0.01, 0, 0}}, {{-0.1, 0, 0}, {0.01, 0, 0}}});
  EXPECT_NEAR(norm(fold.place), 0, 1e-12);
  EXPECT_NEAR(fold.gap.distance, 0.01, 1e-6);
}

TEST_F(Touched, ThePointInsideOneWallOfACreaseIsInside) {
  // It is 5 mm inside one face, whose phyxel is near, and far from the other one.
  const PlaceAtRest fold = found({{{0.1, 0, 0}, {0.005, 0, 0}}, {{-0.1, 0, 0}, {0.045, 0, 0}}});
  EXPECT_LT(fold.gap.distance, -0.004);
  EXPECT_GT(fold.gap.normal.x, 0.9);
}

TEST_F(Touched, PhyxelsAtTheRimOfTheRangeSayNothing) {
  EXPECT_LE(found({{{0.1, 0, 0}, {0.046, 0, 0}}}).weights, least_weight);
  EXPECT_GT(found({{{0.1, 0, 0}, {0.02, 0, 0}}}).weights, 0.4);
}

TEST(DistanceOfALonePoint, FallsToNothingWhereASurfaceIsNear) {
  EXPECT_EQ(distance_of_lone_point(0), 0.3);
  EXPECT_NEAR(distance_of_lone_point(0.2), 0.15, 1e-15);
  EXPECT_EQ(distance_of_lone_point(0.4), 0);
  EXPECT_EQ(distance_of_lone_point(3), 0);
}

/// Phyxels near a point at the origin, with which it is lined up along x now.
class Patches : public ::testing::Test {
 protected:
  /// A phyxel at so many ranges along x at rest, and now; it faces the point, or not.
  void add(double rest, double now, bool faces = true) {
    sites_.push_back({.rest = range * Vec3d{rest, 0, 0}, .range = range});
    motions_.emplace_back();
    motions_.back().after = range * Vec3d{now, 0, 0};
    motions_.back().range = range;
    motions_.back().out = {0, 0, faces ? -1.0 : 1.0};
  }
  /// The patch of each phyxel, and the number of patches.
  std::vector<int> found(int most = most_patches) const {
    SurfaceMotion point;
    point.out = {0, 0, 1};
    const auto count = static_cast<Offset>(sites_.size());
    const std::vector<Offset> list{0, count, count, count, count};
    const SurfacePatches patches(
        OneThread{}, {.range = range}, point, list.data(),
        [&](Offset k) -> const SurfaceSite& { return sites_[k]; },
        [&](Offset k) -> const SurfaceMotion& { return motions_[k]; }, most);
    std::vector<int> all;
    for (const SurfaceSite& site : sites_) all.push_back(patches.of(site.rest));
    all.push_back(patches.count());
    return all;
  }

  std::vector<SurfaceSite> sites_;
  std::vector<SurfaceMotion> motions_;
};

TEST_F(Patches, AreOneWherePhyxelsAreNearEachOtherAtRest) {
  add(0, 0.9);
  add(1.2, 0.1);
  add(2.4, -0.9);
  EXPECT_EQ(found(), (std::vector<int>{0, 0, 0, 1}));
}

TEST_F(Patches, FarFromEachOtherAtRestAreNumberedByTheirDistanceNow) {
  add(0, 0.5);
  add(0.6, 0.4);
  add(9, -0.2);
  add(8.5, -0.3);
  add(20, 0.7);
  EXPECT_EQ(found(), (std::vector<int>{1, 1, 0, 0, 2, 3}));
  EXPECT_EQ(found(2), (std::vector<int>{1, 1, 0, 0, 0, 2}));
}

TEST_F(Patches, DoNotDependOnPhyxelsBeyondTheRangeOrOnOtherSides) {
  add(0, 0.5);
  add(9, -0.6);
  const std::vector<int> before = found();
  EXPECT_EQ(before, (std::vector<int>{0, 1, 2}));
  for (int k = 1; k < 9; ++k) add(k, 1.01);  // they connect both
  add(20, 0.2, false);
  const std::vector<int> after = found();
  EXPECT_EQ(after[0], 0);
  EXPECT_EQ(after[1], 1);
  EXPECT_EQ(after.back(), 2);
}

TEST_F(Patches, ShareTheEntriesOfAPointAmongItsRows) {
  add(0, 0);  // the point
  motions_.back().out = {0, 0, 1};
  add(0, 0.5);
  add(0.6, 0.4);
  add(9, -0.2);
  const std::vector<Index> near{1, 2, 3, 1, 2, 3, 1, 2, 3};
  std::vector<ContactRow> rows;
  std::vector<Offset> start{0};
  for (Index patch = 0; patch < most_patches; ++patch) {
    rows.push_back({.patch = patch, .patches = most_patches});
    for (int thread = 0; thread < contact_threads; ++thread) start.push_back(3 * (patch + 1));
  }
  std::vector<char> in_patch(near.size(), 1);
  const ContactPasses passes{.site = sites_.data(),
                             .motion = motions_.data(),
                             .row = rows.data(),
                             .near_start = start.data(),
                             .near = near.data(),
                             .in_patch = in_patch.data()};
  const OneThread thread;
  for (Index r = 0; r < most_patches; ++r) {
    passes.find_patch(WithinRange(thread, motions_[0], passes.entries_of_row(r), passes.motions()),
                      r);
  }
  EXPECT_EQ(in_patch, (std::vector<char>{0, 0, 1, 1, 1, 0, 0, 0, 0}));
}

TEST_F(Patches, AreLookedForAmongAllEntriesWithinRangeHoweverLongALargeListIs) {
  add(0, 0);  // the point
  for (int k = 0; k < 100; ++k) add(0, k % 3 == 0 ? 0.9 : 1.1);
  std::vector<Offset> expected, found;
  for (Offset k = 1; k <= 100; ++k) {
    if (k % 3 == 1) expected.push_back(k);
  }
  const OneThread thread;
  const std::vector<Offset> list{1, 101, 101, 101, 101};
  const auto motion_of = [&](Offset k) -> const SurfaceMotion& { return motions_[k]; };
  const WithinRange in_range(thread, motions_[0], list.data(), motion_of);
  const WithinRange again(thread, list.data(), in_range.bits());
  // Of the first 64 entries only those within range are looked at, of others all.
  for (const auto& near : {in_range, again}) {
    found.clear();
    near.each(list.data(), [&](Offset k) {
      if (k > 64 && motions_[k].after.x > range) return;
      found.push_back(k);
    });
    EXPECT_EQ(found, expected);
  }
}

TEST_F(Patches, SleepUntilAPhyxelMayHaveComeWithinRange) {
  add(0, 0);  // the point
  add(0, 1.5);
  add(0, 1.2);
  const std::vector<Index> near{1, 2};
  const std::vector<Offset> start{0, 2, 2, 2, 2};
  const ContactRow row;
  SurfaceTouch touch;
  std::vector<SurfaceShare> carries(near.size());
  double wakes = 0;
  PointWay way{.before = 7, .in_step = 0};
  const ContactPasses passes{.site = sites_.data(),
                             .motion = motions_.data(),
                             .row = &row,
                             .near_start = start.data(),
                             .near = near.data(),
                             .touch = &touch,
                             .carries = carries.data(),
                             .wakes = &wakes,
                             .way = &way};
  passes.find_touch(OneThread{}, 0);
  EXPECT_TRUE(touch.is_alone);
  // The nearest lacks a fifth of the range, and each of the two may have gone half of that.
  EXPECT_NEAR(wakes, 7 + 0.1 * range, 1e-3 * range);
  EXPECT_LT(wakes, 7 + 0.1 * range);
  motions_[2].after = range * Vec3d{1.4, 0, 0};
  const double before = wakes;
  way.in_step = 0.09 * range;
  passes.find_touch(OneThread{}, 0);  // asleep: not looked at
  EXPECT_EQ(wakes, before);
  way.in_step = 0.11 * range;
  passes.find_touch(OneThread{}, 0);
  EXPECT_NEAR(wakes, 7 + 0.31 * range, 2e-3 * range);
}

TEST_F(Patches, MayBeSeveralIfPhyxelsAreFarFromOthers) {
  add(0, 0.5);
  add(2.4, -0.5);
  const auto site_of = [&](int k) -> const SurfaceSite& { return sites_[k]; };
  EXPECT_FALSE(is_far_from_others(range, sites_[0], 2, site_of));
  add(2.6, -0.6);
  EXPECT_TRUE(is_far_from_others(range, sites_[0], 3, site_of));
  EXPECT_FALSE(is_far_from_others(range, sites_[1], 3, site_of));
}

}  // namespace
}  // namespace phyxel
