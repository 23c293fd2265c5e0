/// When a point counts as inside a deformed body: in creases of folded limbs, far from all phyxels
/// of a surface, and beside patches that are far from each other at rest.
#include <gtest/gtest.h>

#include <vector>

#include "mesh/distance_field.hpp"
#include "model/assembly.hpp"
#include "phyxel/solver.hpp"
#include "solver/contact_search.hpp"
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
      motions[k].back = identity<double>();
      motions[k].out = {0, 0, -1};
    }
    SurfaceSite site{.range = range};
    SurfaceMotion point;
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

TEST(Patches, AreWhatIsConnectedAtRest) {
  // Steps of 1.5 ranges along a line, a gap of 3, and one phyxel between that comes last.
  std::vector<SurfaceSite> sites;
  for (const double x : {0.0, 1.5, 6.0, 7.5, 3.0, 20.0, 0.5}) {
    sites.push_back({.rest = range * Vec3d{x, 0, 0}, .range = range});
  }
  const auto patches_of = [&](Index count) {
    std::vector<Index> patch(static_cast<std::size_t>(count));
    const Index all = find_patches(
        count, [&](Index k) -> const SurfaceSite& { return sites[k]; },
        [&](Index k) -> Index& { return patch[k]; });
    patch.push_back(all);
    return patch;
  };
  EXPECT_EQ(patches_of(2), (std::vector<Index>{0, 0, 1}));
  EXPECT_EQ(patches_of(4), (std::vector<Index>{0, 0, 1, 1, 2}));
  EXPECT_EQ(patches_of(7), (std::vector<Index>{0, 0, 1, 1, 0, 2, 0, 3}));
}

}  // namespace
}  // namespace phyxel
