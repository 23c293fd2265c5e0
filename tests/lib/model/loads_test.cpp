/// Loads in boxes and balls, and tractions: totals, centroids and torques.
#include "model/loads.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/refusal.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double pi = std::numbers::pi;

Selection in_box(Vec3d low, Vec3d high) {
  Selection select;
  select.box = Selection::Box{low, high};
  return select;
}
Selection in_ball(Vec3d centre, double radius) {
  Selection select;
  select.ball = Selection::Ball{centre, radius};
  return select;
}
Selection everywhere() {
  Selection select;
  select.all = true;
  return select;
}

void expect_near(Vec3d found, Vec3d expected, double tolerance) {
  EXPECT_LT(norm(found - expected), tolerance)
      << fmt::format("({}, {}, {})", found.x, found.y, found.z);
}

struct Sums {
  Vec3d force, torque;  ///< [N], about the origin [N m]
};
Sums sums_of(const Model& model, const Load& load) {
  Sums sums;
  for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
    sums.force += load.force[k];
    sums.torque += cross(model.position[load.phyxels[k]], load.force[k]);
  }
  return sums;
}

/// Pieces whose volumes and centroids are known: of a cube, of a box that sticks out of it, a ball
/// inside, half a ball at a face, and a spherical cap.
TEST(RegionIntegrals, AreThoseOfKnownPieces) {
  const Surface cube = test::unit_cube();
  const auto box = [](Vec3d low, Vec3d high) { return SpaceRegion{.low = low, .high = high}; };
  const BodyPiece whole = piece_in(cube, box({-1, -1, -1}, {2, 2, 2}));
  EXPECT_NEAR(whole.volume, 1, 1e-14);
  expect_near(whole.centroid, {0.5, 0.5, 0.5}, 1e-14);
  const BodyPiece corner = piece_in(cube, box({0.7, -1, 0.25}, {3, 0.4, 0.75}));
  EXPECT_NEAR(corner.volume, 0.3 * 0.4 * 0.5, 1e-14);
  expect_near(corner.centroid, {0.85, 0.2, 0.5}, 1e-13);
  // A box that ends where the cube does, on planes of its triangles.
  const BodyPiece flush = piece_in(cube, box({0, 0, 0.5}, {1, 1, 1}));
  EXPECT_NEAR(flush.volume, 0.5, 1e-14);
  expect_near(flush.centroid, {0.5, 0.5, 0.75}, 1e-14);
  EXPECT_NEAR(piece_in(cube, box({2, 0, 0}, {3, 1, 1})).volume, 0, 1e-14);
  const auto ball = [](Vec3d centre, double radius) {
    return SpaceRegion{.centre = centre, .radius = radius, .is_ball = true};
  };
  const double full = 4 * pi / 3 * std::pow(0.3, 3);
  const BodyPiece inside = piece_in(cube, ball({0.4, 0.5, 0.6}, 0.3));
  EXPECT_NEAR(inside.volume, full, 1e-3 * full);
  expect_near(inside.centroid, {0.4, 0.5, 0.6}, 1e-4);
  const BodyPiece half = piece_in(cube, ball({0, 0.5, 0.5}, 0.3));
  EXPECT_NEAR(half.volume, full / 2, 1e-3 * full);
  expect_near(half.centroid, {3 * 0.3 / 8, 0.5, 0.5}, 1e-4);
  // Cap of height 0.2: π h² (3 r - h) / 3, and its centroid 3 (2 r - h)² / (4 (3 r - h)) from the
  // middle of the ball.
  const BodyPiece cap = piece_in(cube, ball({-0.1, 0.5, 0.5}, 0.3));
  EXPECT_NEAR(cap.volume, pi * 0.04 * 0.7 / 3, 2e-3 * pi * 0.04 * 0.7 / 3);
  expect_near(cap.centroid, {-0.1 + 3 * 0.16 / (4 * 0.7), 0.5, 0.5}, 1e-3 * 0.2);
}

/// The force of a load in a box or a ball, and its torque about the piece's centroid: none.
TEST(Loads, ActOnTheSpaceInTheirRegion) {
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.4, 0.2}), {.phyxels = 900});
  Scene scene = one_body();
  for (const Selection& select :
       {in_box({0.83, -1, -1}, {2, 2, 2}), in_ball({1, 0.2, 0.1}, 0.25)}) {
    const SpaceRegion region =
        select.box
            ? SpaceRegion{.low = select.box->low, .high = select.box->high}
            : SpaceRegion{
                  .centre = select.ball->centre, .radius = select.ball->radius, .is_ball = true};
    const BodyPiece piece = piece_in(cloud.surface, region);
    scene.bodies[0].loads = {{.select = select, .force = {3, -2, 5}},
                             {.select = select, .force_density = {0, 0, -700}}};
    const Model model = build_model(scene, std::span(&cloud, 1));
    for (const Load& load : model.loads) {
      const Sums sums = sums_of(model, load);
      const Vec3d expected =
          &load == &model.loads[0] ? Vec3d{3, -2, 5} : Vec3d{0, 0, -700 * piece.volume};
      expect_near(sums.force, expected, 1e-12 * norm(expected));
      expect_near(sums.torque, cross(piece.centroid, expected), 1e-12 * norm(expected));
      expect_near(load.centroid, piece.centroid, 1e-12);
      for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
        EXPECT_GT(dot(load.force[k], expected), 0);
      }
    }
  }
}

/// A load in a slab that has a single layer of phyxels cannot move along the slab's normal.
TEST(Loads, InOneLayerStayInIt) {
  const Cloud cloud = lattice(6, 6, 6, 0.1);
  Cloud closed = cloud;
  closed.surface = test::box({0, 0, 0}, {0.6, 0.6, 0.6});
  Scene scene = one_body();
  scene.bodies[0].loads = {{.select = in_box({0.5, -1, -1}, {0.59, 1, 0.33}), .force = {1, 0, 0}}};
  const Model model = build_model(scene, std::span(&closed, 1));
  expect_near(model.loads[0].centroid, {0.55, 0.3, 0.165}, 1e-12);
  expect_near(sums_of(model, model.loads[0]).torque, {0, 0.165, -0.3}, 1e-12);
}

TEST(Supports, OfTwoPhyxelsAreWarnedOf) {
  const Cloud cloud = lattice(4, 4, 4, 0.1);
  Scene scene = one_body();
  scene.bodies[0].fixed = {{.select = in_box({0, 0, 0}, {0.1, 0.1, 0.2})},
                           {.select = in_box({0.3, 0, 0}, {0.4, 0.1, 0.4})}};
  scene.bodies[0].motions = {{.select = in_ball({0.35, 0.35, 0.35}, 0.05), .velocity = {1, 0, 0}}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  EXPECT_THAT(
      model.warnings,
      ElementsAre(HasSubstr("body \"body\", fixed 1: only 2 of its phyxels lie in the box"),
                  HasSubstr("body \"body\", motion 1: only 1 of its phyxels lies in the ball")));
}

/// Total and torque of tractions: of a pressure on a face and on all of a body, of a traction in a
/// box that cuts triangles, and of one by the direction of normals.
TEST(Tractions, KeepTotalsAndTorques) {
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.4, 0.2}), {.phyxels = 900});
  Scene scene = one_body();
  scene.bodies[0].tractions = {
      {.select = in_box({0.999, -1, -1}, {2, 2, 2}), .pressure = 50},
      {.select = everywhere(), .pressure = 50},
      {.select = in_box({0.3, -1, 0.19}, {0.73, 1, 0.21}), .traction = {0, 7, -20}},
      {.select = everywhere(), .traction = {1, 2, 3}, .normal = {0, 0.1, 1}}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  ASSERT_EQ(model.loads.size(), 4u);
  const auto expect = [&](std::size_t k, Vec3d force, Vec3d about, double tolerance) {
    const Sums sums = sums_of(model, model.loads[k]);
    expect_near(sums.force, force, tolerance);
    expect_near(model.loads[k].total, force, tolerance);
    expect_near(sums.torque, cross(about, force), tolerance);
  };
  // A layer 0.001 thick of the sides is in the box, too: its pressures cancel, but for the
  // resolution of triangles there. Seen: 2e-6.
  expect(0, {-50 * 0.08, 0, 0}, {1, 0.2, 0.1}, 2e-5);
  expect(1, {0, 0, 0}, {0, 0, 0}, 1e-9);
  // The top, and the upper 0.01 of the sides at y = 0 and y = 0.4.
  const double top = 0.43 * 0.4, sides = 2 * 0.43 * 0.01;
  const double height = (top * 0.2 + sides * 0.195) / (top + sides);
  expect(2, (top + sides) * Vec3d{0, 7, -20}, {0.515, 0.2, height}, 0.01);
  expect(3, 0.4 * Vec3d{1, 2, 3}, {0.5, 0.2, 0.2}, 1e-9);
  EXPECT_EQ(model.loads[3].set, "traction 4");
}

/// A traction in a box that holds a face with a margin is spread over it as one on all of the face:
/// triangles within the box are as fine as elsewhere.
TEST(Tractions, AreSpreadOverTheirTriangles) {
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.4, 0.2}), {.phyxels = 900});
  Scene scene = one_body();
  scene.bodies[0].tractions = {
      {.select = everywhere(), .traction = {1, 0, 0}, .normal = {1, 0, 0}},
      {.select = in_box({0.5, -9, -9}, {9, 9, 9}), .traction = {1, 0, 0}, .normal = {1e-300, 0, 0}},
      {.select = in_ball({1, 0.2, 0.1}, 3),
       .traction = {1, 0, 0},
       .normal = {0, 0, 1},
       .angle = 90},
      {.select = in_box({1, 0, 0}, {1, 0.4, 0.2}), .traction = {1, 0, 0}}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  for (const std::size_t k : {1u, 3u}) {
    EXPECT_EQ(model.loads[k].phyxels, model.loads[0].phyxels);
    EXPECT_EQ(model.loads[k].force, model.loads[0].force);
  }
  // All faces but the lower one, whose normal is opposite.
  expect_near(model.loads[2].total, {2 * 0.08 + 2 * 0.2 + 0.4, 0, 0}, 1e-9);
}

/// In a flat box there is no volume for a force by volume; a force acts on the phyxels there.
TEST(Loads, InFlatBoxes) {
  const Cloud cloud = sample_surface(test::unit_cube(), {.phyxels = 1000});
  Scene scene = one_body();
  scene.bodies[0].loads = {{.select = in_box({1, 0, 0}, {1, 1, 1}), .force = {1, 0, 0}}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  EXPECT_GT(model.loads[0].phyxels.size(), 60u);
  EXPECT_NEAR(model.loads[0].centroid.x, 1, 1e-12);
  scene.bodies[0].loads[0] = {.select = in_box({1, 0, 0}, {1, 1, 1}), .force_density = {1, 0, 0}};
  EXPECT_THAT(refusal_of([&] { build_model(scene, std::span(&cloud, 1)); }),
              HasSubstr("this box holds no part of the inside of body \"body\""));
}

TEST(Tractions, NeedASurface) {
  const Cloud cloud = sample_surface(test::unit_cube(), {.phyxels = 300});
  Scene scene = one_body();
  scene.bodies[0].tractions = {{.select = in_box({2, 2, 2}, {3, 3, 3}), .pressure = 1}};
  EXPECT_THAT(refusal_of([&] { build_model(scene, std::span(&cloud, 1)); }),
              HasSubstr("acts on no part of the surface of body \"body\""));
  const Cloud bare = lattice(4, 4, 4, 0.1);
  scene.bodies[0].tractions = {{.select = everywhere(), .pressure = 1}};
  EXPECT_THAT(refusal_of([&] { build_model(scene, std::span(&bare, 1)); }),
              HasSubstr("which has no triangles"));
}

}  // namespace
}  // namespace phyxel
