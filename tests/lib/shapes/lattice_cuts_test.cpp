/// Boxes that hold a part of a lattice: layers of phyxels on their faces, and where they act.
#include "shapes/lattice_cuts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "model/assembly.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/shapes.hpp"
#include "phyxel/solver.hpp"
#include "shapes/layers.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// Layers ascend, are equally far apart between planes, lie on all of these, and share the whole
/// length among them.
TEST(Layers, LieOnPlanesAndShareTheLength) {
  const std::vector<std::vector<double>> cases{{}, {0.4}, {0.31, 0.95}, {-0.93, -0.3, 0.7}};
  for (const auto& planes : cases) {
    for (const std::array<bool, 2> on_end :
         {std::array{false, false}, {true, false}, {true, true}}) {
      const Layers layers(-1, 2.2, 0.1, on_end, planes);
      const auto n = static_cast<int>(layers.count());
      ASSERT_NEAR(n, 22, 3);
      double sum = 0;
      std::set<double> laid;
      for (int k = 0; k < n; ++k) {
        const auto [below, above] = layers.shares(k);
        sum += below + above;
        if (layers.is_laid(k)) laid.insert(layers.place(k));
        if (k > 0) {
          const double gap = layers.place(k) - layers.place(k - 1);
          EXPECT_GT(gap, 0.06);  // 1.5 distances fit into 0.05 + 0.1 at worst
          EXPECT_LT(gap, 0.16);
          EXPECT_NEAR(gap, layers.spacing(k - 1), 1e-14);
        }
        EXPECT_EQ(layers.first_above(layers.place(k)), k + 1);
      }
      EXPECT_NEAR(sum, 2.2, 1e-13);
      std::set<double> wanted(planes.begin(), planes.end());
      if (on_end[0]) wanted.insert(-1);
      if (on_end[1]) wanted.insert(layers.place(n - 1));
      EXPECT_EQ(laid, wanted);
      if (on_end[1]) {
        EXPECT_NEAR(layers.place(n - 1), 1.2, 1e-14);
      }
    }
  }
}

ShapeRequest block(ShapeRequest::Placement placement, const std::vector<SpaceRegion>& regions) {
  std::vector<SupportRegion> supports;
  for (const SpaceRegion& region : regions) supports.push_back({region});
  return {.name = "block",
          .size = {2, 1, 1},
          .spacing = 0.1,
          .placement = placement,
          .supports = std::move(supports)};
}

SpaceRegion box(Vec3d low, Vec3d high) { return {.low = low, .high = high}; }

double volume_if(const Cloud& cloud, auto&& counts) {
  double sum = 0;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (counts(cloud.position[i])) sum += cloud.volume[i];
  }
  return sum;
}

/// Cells end at the faces of a box: phyxels inside have its volume, those on its faces and outside
/// have the rest.
TEST(LatticeCuts, CellsEndAtFaces) {
  for (const auto placement : {ShapeRequest::Placement::nodes, ShapeRequest::Placement::cells}) {
    for (const double jitter : {0.0, 0.4}) {
      for (const SpaceRegion& region :
           {box({-9, -9, -9}, {-0.43, 9, 9}), box({-0.21, -9, -9}, {0.33, 9, 9}),
            box({0.17, -0.22, -9}, {9, 0.28, 0.13}), box({-0.3, -0.2, -0.1}, {0.3, 0.2, 0.1})}) {
        ShapeRequest request = block(placement, {region});
        request.jitter = jitter;
        const Cloud cloud = make_shape(request);
        ASSERT_EQ(cloud.cuts.list.size(), 1u);
        const SpaceRegion inner = region.shrunk(4 * cloud.cuts.depth);
        const auto length = [&](int axis) {
          const double half = axis == 0 ? 1 : 0.5;
          return std::min(component(region.high, axis), half) -
                 std::max(component(region.low, axis), -half);
        };
        EXPECT_NEAR(volume_if(cloud, [&](Vec3d p) { return inner.contains(p); }),
                    length(0) * length(1) * length(2), 1e-7);  // faces are 1e-7 spacings deep
        EXPECT_NEAR(volume_if(cloud, [](Vec3d) { return true; }), 2, 1e-12);
        // The layer on a face is in the region.
        EXPECT_GT(volume_if(cloud, [&](Vec3d p) { return region.contains(p); }),
                  length(0) * length(1) * length(2) * 1.01);
      }
    }
  }
}

/// Boxes that overlap, or that share a face, or a part of one, share out the whole volume, too, and
/// alike in both orders.
TEST(LatticeCuts, SeveralBoxesKeepTheVolume) {
  const SpaceRegion lower = box({-9, -9, -9}, {-0.4, 9, 0.1});
  for (const SpaceRegion& other :
       {box({-0.7, -9, -0.2}, {0.3, 9, 9}), box({-0.4, -9, -9}, {0.3, 9, 9}),
        box({-0.4, -9, -0.3}, {0.3, 9, 9}), box({-9, -9, 0.1}, {-0.4, 9, 9}),
        box({-9, -0.2, 0.1}, {0.3, 9, 9}), box({-9, -9, 0.1}, {9, 9, 9}),
        box({-9, -9, 0.13}, {0.6, 0.2, 9})}) {
    const Cloud first = make_shape(block(ShapeRequest::Placement::nodes, {lower, other}));
    for (const std::vector<SpaceRegion>& both : {std::vector{lower, other}, {other, lower}}) {
      const Cloud cloud = make_shape(block(ShapeRequest::Placement::nodes, both));
      EXPECT_EQ(cloud.position, first.position);
      EXPECT_EQ(cloud.volume, first.volume);
      EXPECT_EQ(cloud.cuts.list.size(), 2u);
      EXPECT_NEAR(volume_if(cloud, [](Vec3d) { return true; }), 2, 1e-12);
      EXPECT_GT(*std::min_element(cloud.volume.begin(), cloud.volume.end()), 1e-5);
    }
  }
}

/// Regions whose faces are no layers of a lattice leave it as it is.
TEST(LatticeCuts, OtherRegionsChangeNothing) {
  const auto nodes = ShapeRequest::Placement::nodes;
  const Cloud plain = make_shape(block(nodes, {}));
  SpaceRegion turned = box({-9, -9, -9}, {-0.43, 9, 9});
  const double c = std::numbers::sqrt2 / 2;
  turned.edge = {{{c, c, 0}, {-c, c, 0}, {0, 0, 1}}};
  SpaceRegion turned_a_little = box({-9, -9, -9}, {-0.43, 9, 9});
  turned_a_little.edge = {{{1, 1e-7, 0}, {-1e-7, 1, 0}, {0, 0, 1}}};
  const SpaceRegion ball{.centre = {-1, 0, 0}, .radius = 0.43, .is_ball = true};
  for (const SpaceRegion& region : {turned, turned_a_little, ball, box({-9, -9, -9}, {9, 9, 9}),
                                    box({-9, -9, -9}, {-1, 9, 9}), box({2, 2, 2}, {3, 3, 3})}) {
    const Cloud cloud = make_shape(block(nodes, {region}));
    EXPECT_EQ(cloud.position, plain.position);
    EXPECT_EQ(cloud.volume, plain.volume);
    EXPECT_TRUE(cloud.cuts.list.empty());
  }
  // A sphere has no flat faces, and a cylinder two.
  ShapeRequest round{.name = "sphere", .radius = 1, .spacing = 0.1};
  const Cloud sphere = make_shape(round);
  round.supports = {{box({-9, -9, -9}, {-0.43, 9, 9})}};
  EXPECT_EQ(make_shape(round).position, sphere.position);
}

/// Far from the origin, the digits of coordinates do not tell a layer from a face of its box.
TEST(LatticeCuts, EndWhereCoordinatesAreTooCoarse) {
  for (const double far : {1e6, 1e9}) {
    BodyRequest body;
    body.source.shape = {.name = "beam",
                         .size = {2, 0.5, 0.5},
                         .spacing = 0.05,
                         .placement = ShapeRequest::Placement::nodes};
    body.translation = {far, 0, 0};
    Selection select;
    select.box = Selection::Box{{far - 9, -9, -9}, {far + 0.33, 9, 9}};
    body.fixed = {{.select = select}};
    const Cloud cloud = make_cloud(body);
    const bool is_far = far > 1e8 * 0.05;
    EXPECT_EQ(cloud.cuts.list.size(), is_far ? 0u : 1u) << far;
    EXPECT_EQ(cloud.warnings.size(), is_far ? 1u : 0u) << far;  // that supports act by centres
  }
}

/// A thin box has one layer, in its middle; one that ends just inside the body has one on its face.
TEST(LatticeCuts, ThinBoxesHaveOneLayer) {
  const Cloud middle =
      make_shape(block(ShapeRequest::Placement::nodes, {box({0.30, -9, -9}, {0.34, 9, 9})}));
  EXPECT_EQ(std::count_if(middle.position.begin(), middle.position.end(),
                          [](Vec3d p) { return p.x == 0.32; }),
            11 * 11);
  EXPECT_TRUE(middle.cuts.list.empty());
  const Cloud end =
      make_shape(block(ShapeRequest::Placement::nodes, {box({-9, -9, -9}, {-0.97, 9, 9})}));
  const auto place = [](double x) { return [x](Vec3d p) { return std::abs(p.x - x) < 1e-7; }; };
  EXPECT_EQ(std::count_if(end.position.begin(), end.position.end(), place(-0.97)), 11 * 11);
  EXPECT_NEAR(volume_if(end, place(-1)), 0.03, 1e-7);
  EXPECT_NEAR(volume_if(end, [](Vec3d) { return true; }), 2, 1e-12);
}

/// How a body is held: by a box up to a place along its axis.
struct Clamped {
  const char* shape;
  ShapeRequest::Placement placement;
  double clamp;
  Vec3d rotation{};
  double scale = 1;
};

/// A bar of length 1 under its own weight along its axis, ν = 0. Its end goes ρ g l² / (2 E), l
/// from the clamp.
/// @returns how far from its box the clamp acts [spacings]; positive: the free length is too short
double clamp_error(const Clamped& held) {
  constexpr double young = 1e6, density = 1000, weight = 0.1, spacing = 0.05;
  Scene scene = one_body(
      {.young = young, .poisson = 0, .density = density, .law = SmallStrain<double>::name});
  BodyRequest& body = scene.bodies[0];
  ShapeRequest& shape = body.source.shape;
  const bool round = std::string(held.shape) == "cylinder";
  shape.name = held.shape;
  shape.size = {1, 0.3, 0.3};
  shape.radius = 0.15;
  shape.length = 1;
  shape.spacing = spacing;
  shape.placement = held.placement;
  body.source.mesh.clear();
  body.rotation = held.rotation;
  body.scale = held.scale;
  const Mat3d rotation = rotation_of(body);
  const Vec3d axis = rotation * (round ? Vec3d{0, 0, 1} : Vec3d{1, 0, 0});
  // The bar then begins at the origin.
  if (round) body.translation = (0.5 * held.scale) * axis;
  Selection select;
  select.box = Selection::Box{{-9, -9, -9}, {9, 9, 9}};
  for (int k = 0; k < 3; ++k) {
    const double along = component(axis, k);
    double* const low[] = {&select.box->low.x, &select.box->low.y, &select.box->low.z};
    double* const high[] = {&select.box->high.x, &select.box->high.y, &select.box->high.z};
    if (along > 0.5) *high[k] = held.scale * held.clamp;
    if (along < -0.5) *low[k] = -held.scale * held.clamp;
  }
  body.fixed = {{.select = select}};
  scene.gravity = weight * axis;
  const Model model = build_model(scene);
  const auto backend = make_test_backend(model, Precision::double_);
  const State rest = find_equilibrium(model, *backend).state;
  // u = ρ g (l s - s² / 2) / E at a distance s from the clamp, whose mean over layers near the end
  // tells l.
  double sum = 0, terms = 0;
  for (Index i = 0; i < model.size(); ++i) {
    const double x = dot(model.position[i], axis) / held.scale;
    if (x < 0.9) continue;
    const double u =
        dot(rest.displacement[i], axis) * young / (density * weight) / held.scale / held.scale;
    // (1 - c) (x - c) - (x - c)² / 2 = u, solved for the clamp's place c.
    sum += 1 - std::sqrt(std::max(2 * u + (1 - x) * (1 - x), 0.0)) - held.clamp;
    terms += 1;
  }
  return sum / terms / spacing;
}

TEST(LatticeCuts, HoldBodiesWhereBoxesEnd) {
  const auto nodes = ShapeRequest::Placement::nodes, cells = ShapeRequest::Placement::cells,
             fitted = ShapeRequest::Placement::fitted;
  for (const Clamped& held : std::initializer_list<Clamped>{{"beam", nodes, 0.30},
                                                            {"beam", nodes, 0.311},
                                                            {"beam", nodes, 0.33},
                                                            {"beam", nodes, 0.345},
                                                            {"beam", nodes, 0.012},
                                                            {"beam", nodes, 0.035},
                                                            {"beam", nodes, 0.06},
                                                            {"beam", cells, 0.33},
                                                            {"beam", nodes, 0.33, {0, 0, 90}},
                                                            {"beam", nodes, 0.33, {0, 90, 0}, 3},
                                                            {"cylinder", nodes, 0.33},
                                                            {"cylinder", nodes, 0.33, {0, 90, 0}},
                                                            {"cylinder", cells, 0.33},
                                                            {"cylinder", fitted, 0.33},
                                                            {"beam", fitted, 0.33}}) {
    EXPECT_LT(std::abs(clamp_error(held)), 0.1)  // without layers on faces: up to 0.9
        << held.shape << ", placement " << static_cast<int>(held.placement) << ", " << held.clamp;
  }
}

/// A rod, ν = 0, clamped at one end, bends under its weight as Timoshenko's beam does. Its phyxels
/// lie on its round side: those of a lattice, whose outermost lie below it, bend by 7% more.
TEST(FittedShapes, BendAsBeamsDo) {
  constexpr double young = 1e6, density = 1000, weight = 0.01, radius = 0.1;
  Scene scene = one_body(
      {.young = young, .poisson = 0, .density = density, .law = SmallStrain<double>::name});
  BodyRequest& body = scene.bodies[0];
  body.source.shape = {.name = "cylinder",
                       .radius = radius,
                       .length = 1,
                       .placement = ShapeRequest::Placement::fitted};
  body.source.phyxels = 2000;
  body.material.hourglass = 0.1;
  body.fixed = {{.select = {.region = "z-"}}};
  scene.gravity = {weight, 0, 0};
  const Model model = build_model(scene);
  ASSERT_EQ(model.size(), 2000);
  const auto backend = make_test_backend(model, Precision::double_);
  const State rest = find_equilibrium(model, *backend).state;
  double sum = 0, volume = 0;
  for (Index i = 0; i < model.size(); ++i) {
    if (model.position[i].z < 0.5 - 1e-6) continue;
    sum += model.volume[i] * rest.displacement[i].x;
    volume += model.volume[i];
  }
  // w L⁴ / (8 E I) + w L² / (2 k G A), with I = A R² / 4 and k = 6/7 (Cowper 1966, ν = 0).
  const double expected = density * weight / young * (4 / (8 * radius * radius) + 2.0 / 2 * 7 / 6);
  // Seen: 0.55%, of which 0.1% is that of the polygons in place of circles.
  EXPECT_NEAR(sum / volume, expected, 0.007 * expected);
}

/// Phyxels of fitted shapes are as many as asked, fill the body, and lie on its faces.
TEST(FittedShapes, HavePhyxelsOnTheirFaces) {
  ShapeRequest rod{
      .name = "cylinder", .radius = 0.5, .length = 2, .placement = ShapeRequest::Placement::fitted};
  rod.spacing = spacing_for(rod, 3000);
  const Cloud cloud = make_shape(rod);
  ASSERT_EQ(cloud.position.size(), 3000u);
  EXPECT_FALSE(cloud.lattice);
  const auto always = [](Vec3d) { return true; };
  EXPECT_NEAR(volume_if(cloud, always) / (std::numbers::pi / 2), 1, 1e-12);  // rounding
  const auto count = [&](auto&& counts) {
    return static_cast<double>(std::count_if(cloud.position.begin(), cloud.position.end(), counts));
  };
  const double a = rod.spacing;
  // A polygon of 128 corners has 0.04% less area than its circle.
  const auto on_side = [](Vec3d p) { return std::hypot(p.x, p.y) > 0.5 * (1 - 4e-4); };
  // About one for each square of the spacing.
  EXPECT_NEAR(count(on_side) * a * a / (2 * std::numbers::pi), 1, 0.15);
  for (const auto& [name, z] : {std::pair{"z-", -1.0}, std::pair{"z+", 1.0}}) {
    for (const Index i : cloud.regions.at(name)) EXPECT_NEAR(cloud.position[i].z, z, 1e-12);
    EXPECT_EQ(static_cast<double>(cloud.regions.at(name).size()),
              count([z = z](Vec3d p) { return std::abs(p.z - z) < 1e-12; }));
  }
  ShapeRequest graded = rod;
  graded.grading = Grading{.ratio = 3, .finer = {{box({-1, -1, 0.8}, {1, 1, 1}), 3}}};
  const Cloud finer = make_shape(graded);
  EXPECT_EQ(finer.position.size(), 3000u);
  const auto [least, most] = std::minmax_element(finer.spacing.begin(), finer.spacing.end());
  EXPECT_GT(*most / *least, 2);
  graded.placement = ShapeRequest::Placement::nodes;
  EXPECT_THROW(make_shape(graded), InputError);
  rod.jitter = 0.1;
  EXPECT_THROW(make_shape(rod), InputError);
  rod.jitter = 0;
  rod.surface = false;
  EXPECT_THROW(make_shape(rod), InputError);
}

}  // namespace
}  // namespace phyxel
