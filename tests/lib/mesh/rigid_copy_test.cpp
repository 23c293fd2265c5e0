/// Surfaces that are copies of each other by a rigid motion.
#include "mesh/rigid_copy.hpp"

#include <gtest/gtest.h>

#include "model/assembly.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

Surface moved(Surface surface, const Mat3d& turn, Vec3d place) {
  for (Vec3d& x : surface.position) x = turn * x + place;
  return surface;
}

/// A surface without symmetry.
Surface skew() {
  Surface surface = test::sphere({0.1, 0.2, 0.3}, 1, 2);
  for (std::size_t v = 0; v < surface.position.size(); ++v) {
    Vec3d& x = surface.position[v];
    x = {x.x + 0.2 * x.y * x.z, 0.7 * x.y, 1.3 * x.z + 0.1 * x.x * x.x};
  }
  return surface;
}

TEST(RigidCopy, OfATranslationHasExactlyTheIdentity) {
  const Surface from = skew();
  const Vec3d place{3.1, -0.7, 1e3 / 7};
  const auto found = rigid_motion_between(from, moved(from, identity<double>(), place));
  ASSERT_TRUE(found);
  for (int e = 0; e < 9; ++e) EXPECT_EQ(found->turn(e / 3, e % 3), e % 4 == 0 ? 1 : 0);
  EXPECT_LE(norm(found->place - place), 1e-12);
}

TEST(RigidCopy, OfARotationIsFoundToRounding) {
  const Surface from = skew();
  const Mat3d turn = rotation_by({2.1, -0.4, 1.3});
  const Vec3d place{-5, 2, 8};
  const auto found = rigid_motion_between(from, moved(from, turn, place));
  ASSERT_TRUE(found);
  for (int e = 0; e < 9; ++e) {
    EXPECT_NEAR(found->turn(e / 3, e % 3), turn(e / 3, e % 3), 1e-14);
  }
  EXPECT_LE(norm(found->place - place), 1e-13);
}

TEST(RigidCopy, IsNoMirrorImageNorABentOrScaledOrOtherSurface) {
  const Surface from = skew();
  Mat3d mirror = identity<double>();
  mirror(0, 0) = -1;
  EXPECT_FALSE(rigid_motion_between(from, moved(from, mirror, {})));
  EXPECT_FALSE(rigid_motion_between(from, moved(from, (1 + 1e-9) * identity<double>(), {})));
  Surface bent = from;
  bent.position[7].y += 1e-9;
  EXPECT_FALSE(rigid_motion_between(from, bent));
  Surface other = from;
  std::swap(other.triangle[0], other.triangle[1]);
  EXPECT_FALSE(rigid_motion_between(from, other));
  other = from;
  other.position.emplace_back();
  EXPECT_FALSE(rigid_motion_between(from, other));
}

}  // namespace
}  // namespace phyxel
