/// Regions of space that end inside bodies made from meshes: where the phyxels of their supports
/// lie, and where the supports act.
#include "mesh/cuts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>

#include "mesh/small_volumes.hpp"
#include "model/assembly.hpp"
#include "model/spatial_hash.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/point_fields.hpp"
#include "phyxel/shapes.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/mesh_content.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

const SpaceRegion slab{.low = {-1, -1, -1}, .high = {0.43, 2, 2}};
const SpaceRegion ball{.centre = {0.1, 0.5, 0.45}, .radius = 0.37, .is_ball = true};

TEST(SpaceRegion, MeasuresDistancesFromItsBoundary) {
  const SpaceRegion box{.low = {0, 0, 0}, .high = {1, 2, 3}};
  EXPECT_TRUE(box.contains({1, 2, 3}));
  EXPECT_FALSE(box.contains({1.0000001, 2, 3}));
  EXPECT_DOUBLE_EQ(box.distance({0.3, 1, 1}), -0.3);
  EXPECT_DOUBLE_EQ(box.distance({4, 6, 3}), 5);
  EXPECT_EQ(box.nearest_on_boundary({0.8, 1, 1}), (Vec3d{1, 1, 1}));
  EXPECT_EQ(box.nearest_on_boundary({4, 1, 5}), (Vec3d{1, 1, 3}));
  EXPECT_EQ(box.nearest_on_boundary({4, 1, 1}, 0.25), (Vec3d{0.75, 1, 1}));
  // An inset deeper than the box ends in its middle.
  EXPECT_EQ(box.nearest_on_boundary({4, 1, 1}, 0.75), (Vec3d{0.5, 1, 1}));
  EXPECT_DOUBLE_EQ(ball.distance({0.1, 0.5, 0.95}), 0.13);
  EXPECT_NEAR(norm(ball.nearest_on_boundary({0.2, 0.6, 0.9}, 0.01) - ball.centre), 0.36, 1e-15);
  EXPECT_DOUBLE_EQ(ball.shrunk(0.1).radius, 0.27);
  EXPECT_FALSE(ball.shrunk(1).contains(ball.centre));
  EXPECT_EQ(box.shrunk(0.25).high, (Vec3d{0.75, 1.75, 2.75}));
}

/// A region in the coordinates of a body that is not yet placed contains the points that are in the
/// region after placement.
TEST(SpaceRegion, IsTheSameBeforePlacement) {
  const Mat3d rotation = rotation_by({0.3, -1.1, 0.7});
  const Vec3d translation{0.4, -2, 0.1};
  std::mt19937_64 engine(3);
  for (const SpaceRegion& region : {slab, ball}) {
    const SpaceRegion before = region.before_placement(2.5, rotation, translation);
    for (int k = 0; k < 200; ++k) {
      const Vec3d p = uniform_vector(engine, 1), placed = rotation * (2.5 * p) + translation;
      EXPECT_NEAR(2.5 * before.distance(p), region.distance(placed), 1e-14);
      const Vec3d on = before.nearest_on_boundary(p);
      EXPECT_NEAR(region.distance(rotation * (2.5 * on) + translation), 0, 1e-14);
    }
  }
}

/// Phyxels lie on the boundary of a region as densely as elsewhere, all others keep their distance,
/// and cells end at the boundary.
TEST(Cuts, HavePhyxelsAllOver) {
  for (const SpaceRegion& region : {slab, ball}) {
    SampleReport report;
    const Cloud cloud =
        sample_surface(test::unit_cube(), {.phyxels = 5000, .cuts = {region}}, &report);
    ASSERT_EQ(cloud.position.size(), 5000u);
    ASSERT_TRUE(report.warnings.empty());
    const double spacing = std::cbrt(1.0 / 5000);
    ASSERT_EQ(cloud.cuts.list.size(), 1u);
    EXPECT_EQ(cloud.cuts.list[0].support, region);
    EXPECT_LT(cloud.cuts.depth, 1e-6 * spacing);
    std::vector<Vec3d> on_cut;
    for (const Vec3d p : cloud.position) {
      if (std::abs(region.distance(p)) > 1e-6 * spacing) continue;
      EXPECT_TRUE(region.contains(p));
      on_cut.push_back(p);
    }
    const SpatialHash hash(on_cut, spacing);
    std::mt19937_64 engine(7);
    int places = 0;
    double farthest = 0;
    for (int k = 0; k < 4000; ++k) {
      const Vec3d p =
          region.nearest_on_boundary(Vec3d{0.5, 0.5, 0.5} + uniform_vector(engine, 0.5));
      if (std::min({p.x, p.y, p.z}) < 0 || std::max({p.x, p.y, p.z}) > 1) continue;
      farthest = std::max(farthest, std::sqrt(hash.nearest(p).distance2));
      ++places;
    }
    ASSERT_GT(places, 300);
    // Points of a square lattice leave holes of 0.71 spacings.
    EXPECT_LT(farthest, 0.95 * spacing);
    EXPECT_GT(report.smallest_gap, 0.45 * spacing);  // without cuts: 0.5
    double volume = 0;
    for (const double v : cloud.volume) volume += v;
    EXPECT_NEAR(volume, 1, 1e-12);
  }
}

TEST(Cuts, ThatEndWhereTheBodyDoesAreNone) {
  const SampleRequest plain{.phyxels = 2000};
  SampleRequest cut = plain;
  cut.cuts = {{.low = {-1, -1, -1}, .high = {0.001, 2, 2}}, {.low = {2, 2, 2}, .high = {3, 3, 3}}};
  const Cloud made = sample_surface(test::unit_cube(), cut);
  EXPECT_EQ(made.position, sample_surface(test::unit_cube(), plain).position);
  EXPECT_TRUE(made.cuts.list.empty());
}

/// A bar of length 1, held up to some place, under its own weight along its axis. Its end goes
/// ρ g l² / (2 E), l from the clamp.
/// @param turned whether the bar lies along y instead of x
/// @returns how far from `clamp` the clamp acts [spacings]; positive: the free length is too short
double clamp_error(double clamp, Index phyxels, bool turned) {
  constexpr double young = 1e6, density = 1000, weight = 0.1;
  Scene scene = one_body(
      {.young = young, .poisson = 0, .density = density, .law = SmallStrain<double>::name});
  BodyRequest& body = scene.bodies[0];
  body.source.mesh = "bar.obj";  // the cuts of a body are those of its mesh
  if (turned) body.rotation = {0, 0, 90};
  Selection held;
  held.box = Selection::Box{{-9, -9, -9}, {9, 9, 9}};
  (turned ? held.box->high.y : held.box->high.x) = clamp;
  body.fixed = {{.select = held}};
  const Vec3d along = turned ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0};
  scene.gravity = weight * along;
  Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.3, 0.3}),
                               {.phyxels = phyxels, .cuts = regions_of(source_of(body).supports)});
  place(cloud, body);
  body.source = {};
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  const State rest = find_equilibrium(model, *backend).state;
  double end = 0, volume = 0;
  for (Index i = 0; i < model.size(); ++i) {
    if (dot(model.position[i], along) < 1 - 1e-9) continue;
    end += model.volume[i] * dot(rest.displacement[i], along);
    volume += model.volume[i];
  }
  const double length = std::sqrt(2 * young / (density * weight) * end / volume);
  return (1 - clamp - length) / std::cbrt(0.09 / phyxels);
}

/// A bar, ν = 0, held in a box and pulled at its end, has one strain in all of its free part: at
/// the clamp as elsewhere, since nothing smears strains across the box's boundary, and since forces
/// on held phyxels do not count where gradients are closed.
TEST(Cuts, LeaveAUniformStrainBeside) {
  Scene scene =
      one_body({.young = 1e6, .poisson = 0, .density = 1000, .law = SmallStrain<double>::name});
  BodyRequest& body = scene.bodies[0];
  body.source.mesh = "bar.obj";
  Selection held, all;
  held.box = Selection::Box{{-9, -9, -9}, {0.33, 9, 9}};
  all.all = true;
  body.fixed = {{.select = held}};
  body.tractions = {{.select = all, .traction = {1000, 0, 0}, .normal = {1, 0, 0}}};
  body.closure = 1e-4;
  Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.3, 0.3}),
                               {.phyxels = 1500, .cuts = regions_of(source_of(body).supports)});
  place(cloud, body);
  body.source = {};
  const Model model = build_model(scene, std::span(&cloud, 1));
  EXPECT_TRUE(model.warnings.empty()) << model.warnings[0];
  const auto backend = make_test_backend(model, Precision::double_);
  find_equilibrium(model, *backend);
  const Quantity wanted[] = {Quantity::strain};
  const std::vector<double> strain = find_fields(model, *backend, wanted).at(Quantity::strain);
  double worst = 0;
  for (Index i = 0; i < model.size(); ++i) {
    // Beside the pulled end, strains depend on how the traction is shared out.
    if (model.position[i].x < 0.33 - 1e-6 || model.position[i].x > 0.6) continue;
    worst = std::max(worst, std::abs(strain[6 * static_cast<std::size_t>(i)] / 1e-3 - 1));
  }
  EXPECT_LT(worst, 0.005);  // seen: 0.0016
}

TEST(Cuts, HoldBodiesWhereSupportsEnd) {
  for (const double clamp : {0.31, 0.325, 0.34, 0.355}) {
    const double error = clamp_error(clamp, 1500, false);

    EXPECT_LT(std::abs(error), 0.1);
  }
  EXPECT_LT(std::abs(clamp_error(0.33, 1500, true)), 0.1);
}

/// A unit cube of about 10 phyxels along an edge, held in boxes.
struct HeldCube {
  Scene scene = one_body();
  Cloud cloud;
  Model model;

  explicit HeldCube(const std::vector<Selection::Box>& boxes, const std::vector<Axes>& axes = {}) {
    BodyRequest& body = scene.bodies[0];
    body.source.mesh = "cube.obj";
    for (std::size_t k = 0; k < boxes.size(); ++k) {
      Selection select;
      select.box = boxes[k];
      body.fixed.push_back({.select = select, .axes = axes.empty() ? Axes{} : axes[k]});
    }
    cloud = sample_surface(test::unit_cube(),
                           {.phyxels = 1000, .cuts = regions_of(source_of(body).supports)});
    place(cloud, body);
    body.source = {};
    model = build_model(scene, std::span(&cloud, 1));
  }
  /// Pairs across the plane x = `wall`, but for those of phyxels on it.
  int pairs_across(double wall) const {
    int count = 0;
    for (Index i = 0; i < model.size(); ++i) {
      if (model.position[i].x >= wall - 1e-6) continue;
      for (const Index j : model.neighbourhood.neighbours.row(i)) {
        count += model.position[j].x > wall - 1e-6;
      }
    }
    return count;
  }
};

HeldCube held_in(Vec3d low, Vec3d high) {
  return HeldCube(std::vector<Selection::Box>{{low, high}});
}

TEST(Cuts, PartPhyxelsThatAreHeldAlongAllAxes) {
  const Selection::Box half{{-1, -1, -1}, {0.5, 2, 2}};
  EXPECT_EQ(HeldCube({half}).pairs_across(0.5), 0);
  EXPECT_EQ(HeldCube({half, half}, {{true, false, false}, {false, true, true}}).pairs_across(0.5),
            0);
  EXPECT_GT(HeldCube({half}, {{true, true, false}}).pairs_across(0.5), 100);
}

/// The layer in front of a box that begins 0.02 or 0.04 below a face has no room for phyxels on the
/// box's boundary: it stays with those inside, whether the box ends with the body's sides, leaves a
/// thin layer there, too, or is well inside.
TEST(Cuts, LeaveNoThinLayerLoose) {
  for (const Selection::Box& box :
       {Selection::Box{{0.02, 0, 0}, {1, 1, 1}}, Selection::Box{{0.02, -1, -1}, {2, 2, 2}},
        Selection::Box{{0.02, 1e-9, 0.03}, {1, 1 - 1e-9, 0.97}},
        Selection::Box{{0.02, 0.3, 0.3}, {0.7, 0.8, 0.8}},
        Selection::Box{{0.04, -1, -1}, {2, 2, 2}}, Selection::Box{{0.05, 0.1, 0.1}, {0.9, 2, 2}}}) {
    const HeldCube cube = held_in(box.low, box.high);
    EXPECT_TRUE(cube.model.degenerate.none()) << cube.model.degenerate.describe();
    for (Index i = 0; i < cube.model.size(); ++i) {
      const Vec3d x = cube.model.position[i];
      if (x.x > 0 || std::max({std::abs(x.y - 0.55), std::abs(x.z - 0.55)}) > 0.2) continue;
      const auto row = cube.model.neighbourhood.neighbours.row(i);
      EXPECT_TRUE(std::any_of(row.begin(), row.end(), [&](Index j) {
        return cube.scene.bodies[0].fixed[0].select.box->low.x <= cube.model.position[j].x;
      }));
    }
  }
}

/// A box whose faces are the body's holds what a larger one does, with the same phyxels.
TEST(Cuts, EndWithTheBodyWhereFacesAreTheSame) {
  const HeldCube exact = held_in({0, 0, 0}, {0.5, 1, 1}),
                 larger = held_in({-1, -1, -1}, {0.5, 2, 2});
  EXPECT_EQ(exact.model.position, larger.model.position);
  EXPECT_EQ(exact.model.volume, larger.model.volume);
  EXPECT_EQ(exact.model.motions[0].phyxels, larger.model.motions[0].phyxels);
  EXPECT_EQ(exact.model.neighbourhood.neighbours.indices,
            larger.model.neighbourhood.neighbours.indices);
}

/// Boxes whose faces cut a ball at any height, and so at any angle to its surface, leave steps as
/// long as those without a support: phyxels in the wedges beside the cut are either held, or have
/// neighbours that are not nearly in a plane.
TEST(Cuts, LeaveStepsAsLongAsWithoutSupports) {
  const Surface surface = test::sphere({0, 0, 0}, 1, 3);
  const auto step_held_to = [&](std::optional<double> height) {
    Scene scene = one_body();
    BodyRequest& body = scene.bodies[0];
    body.source.mesh = "ball.obj";
    if (height) {
      Selection held;
      held.box = Selection::Box{{-9, -9, -9}, {9, *height, 9}};
      body.fixed = {{.select = held}};
    }
    Cloud cloud =
        sample_surface(surface, {.phyxels = 600, .cuts = regions_of(source_of(body).supports)});
    place(cloud, body);
    body.source = {};
    return step_limit(build_model(scene, std::span(&cloud, 1)), 1).largest_step;
  };
  const double without = step_held_to(std::nullopt);
  for (int k = 1; k < 20; ++k) {
    const double height = -1 + 0.1 * k;
    EXPECT_GT(step_held_to(height), 0.5 * without) << height;
  }
}

/// The largest step of a cylinder of radius 1 and length 3 that a ball holds along some axes.
double step_of_cylinder(const std::optional<Selection::Ball>& support, Axes axes = {}) {
  Scene scene = one_body();
  BodyRequest& body = scene.bodies[0];
  ShapeRequest& shape = body.source.shape;
  shape.name = "cylinder";
  shape.radius = 1;
  shape.length = 3;
  shape.placement = ShapeRequest::Placement::fitted;
  shape.spacing = spacing_for(shape, 2500);
  if (support) {
    Selection held;
    held.ball = support;
    body.fixed = {{.select = held, .axes = axes}};
  }
  return step_limit(build_model(scene), 1).largest_step;
}

/// Balls that cut a body's surface and its edges at sharp angles cost no more than half of the
/// step, where all axes are held, and little more where one axis is.
TEST(Cuts, AtSharpAnglesLeaveStepsLong) {
  const double without = step_of_cylinder(std::nullopt);
  for (const Selection::Ball& support :
       {Selection::Ball{{0.462, -0.585, 1.238}, 0.358},
        Selection::Ball{{-0.227, 0.811, -0.896}, 0.6225},
        Selection::Ball{{-0.544183, 0.083944, -0.865472}, 0.779151},
        Selection::Ball{{-0.04858, -0.575602, 1.172445}, 0.610149}}) {
    EXPECT_GT(step_of_cylinder(support), 0.4 * without) << support.radius;
    EXPECT_GT(step_of_cylinder(support, {false, false, true}), 0.2 * without) << support.radius;
  }
}

/// In the wedge of 9 degrees between a face and a cut, no free phyxel has a tiny volume.
TEST(Cuts, LeaveNoTinyVolumesInWedges) {
  const SpaceRegion tilted = SpaceRegion{.low = {-9, -9, -9}, .high = {0.5, 9, 9}}.placed(
      1, rotation_by({0, 0, 0.9 * std::numbers::pi / 2}), {0, 0.35, 0});
  const Cloud cloud = sample_surface(test::unit_cube(), {.phyxels = 3000, .cuts = {tilted}});
  const double spacing = std::cbrt(1.0 / 3000);
  int on_cut = 0;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    const double distance = tilted.distance(cloud.position[i]);
    on_cut += std::abs(distance) < 1e-6;
    if (distance > 1e-6 && distance < spacing) {
      EXPECT_GT(cloud.volume[i], 0.19 * std::pow(spacing, 3)) << distance;
    }
  }
  EXPECT_GT(on_cut, 100);
}

/// A small volume is raised at the cost of those beside it that may change, and of no other.
TEST(Cuts, RaiseVolumesFromPointsThatMayChange) {
  SupportCuts cuts;
  cuts.list = {{slab, slab}};
  const Vec3d points[] = {{0.5, 0, 0}, {1.3, 0, 0}, {0.5, 0.9, 0}};
  std::vector<double> volume{0.01, 1, 1};
  raise_small_volumes(points, cuts, SpacingField(1), volume, [](std::size_t k) { return k != 1; });
  EXPECT_NEAR(volume[0], 0.2, 1e-15);
  EXPECT_EQ(volume[1], 1);
  EXPECT_NEAR(volume[2], 0.81, 1e-15);
}

/// A face along which a cut runs keeps its phyxels, however near the cut is: only wedges beside
/// curves of sharp angles lose theirs.
TEST(Cuts, BelowAFaceLeaveItsPhyxels) {
  constexpr Index phyxels = 3000;
  const double of_cube = std::cbrt(1.0 / phyxels);
  const auto on_top = [&](double below) {
    SampleRequest request{.phyxels = phyxels};
    if (below > 0) request.cuts = {{.low = {-1, -1, -1}, .high = {2, 2, 1 - below * of_cube}}};
    const Cloud cloud = sample_surface(test::unit_cube(), request);
    return std::count_if(cloud.position.begin(), cloud.position.end(),
                         [](Vec3d p) { return p.z > 1 - 1e-9; });
  };
  const auto plain = static_cast<double>(on_top(0));
  EXPECT_GT(plain, 150);
  for (const double below : {0.2, 0.38, 0.42, 0.5}) {
    EXPECT_NEAR(static_cast<double>(on_top(below)), plain, 0.1 * plain) << below;
  }
  const Surface ball_surface = test::sphere({0, 0, 0}, 1, 3);
  const double spacing = std::cbrt(4.0 / 3 * std::numbers::pi / phyxels);
  const auto on_ball = [&](double below) {
    SampleRequest request{.phyxels = phyxels};
    if (below > 0) {
      request.cuts = {{.centre = {0, 0, 0}, .radius = 1 - below * spacing, .is_ball = true}};
    }
    SampleReport report;
    sample_surface(ball_surface, request, &report);
    EXPECT_TRUE(report.warnings.empty()) << report.warnings[0];
    return static_cast<double>(report.on_surface);
  };
  const double everywhere = on_ball(0);
  EXPECT_GT(everywhere, 500);
  for (const double below : {0.1, 0.3, 0.42, 0.6}) {
    EXPECT_NEAR(on_ball(below), everywhere, 0.1 * everywhere) << below;
  }
}

/// Sharp edges have phyxels where a cut crosses them, also if an edge of the mesh ends just there.
TEST(Cuts, HavePhyxelsOnSharpEdgesThatEndOnThem) {
  for (const double end : {0.36, 0.399, 0.4, 0.41, 0.6}) {
    ShapeRequest bar{.name = "beam", .size = {1, 0.2, 0.2}, .spacing = 0.04};
    bar.placement = ShapeRequest::Placement::fitted;
    bar.supports = {{.region = {.low = {-9, -9, -9}, .high = {end, 9, 9}}, .holds_all = true}};
    const SpatialHash hash(make_shape(bar).position, 0.04);
    for (const double y : {-0.1, 0.1}) {
      for (const double z : {-0.1, 0.1}) {
        EXPECT_LT(hash.nearest({end, y, z}).distance2, 1e-10) << end;
      }
    }
  }
}

/// A box thinner than a spacing holds one layer, in its middle.
TEST(Cuts, OfThinBoxesAreOneLayer) {
  const HeldCube cube = held_in({0.47, -1, -1}, {0.49, 2, 2});
  const std::vector<Index>& held = cube.model.motions[0].phyxels;
  const auto in_the_middle = std::count_if(held.begin(), held.end(), [&](Index i) {
    return std::abs(cube.model.position[i].x - 0.48) < 1e-6;
  });
  EXPECT_GT(in_the_middle, 60);  // 9 x 9 fill it; a few beside them lie in the box by chance
  EXPECT_LT(held.size(), 100u);
}

TEST(Cuts, OfCopiesAreTheSame) {
  BodyRequest body;
  body.source.mesh = "cube.obj";
  Selection select;
  select.box = Selection::Box{{0.1, -1, -1}, {0.3, 2, 2}};
  body.fixed = {{.select = select}};
  const CutSource first = source_of(body);
  int rounded = 0;
  for (int k = 1; k < 20; ++k) {
    const Vec3d by{0.7 * k, 0.1 * k, 0};
    BodyRequest copy = body;
    copy.translation += by;
    copy.fixed[0].select.box = {select.box->low + by, select.box->high + by};
    const CutSource other = source_of(copy);
    rounded += !(other.supports == first.supports);
    EXPECT_TRUE(is_same(first, other));
    copy.fixed[0].select.box->high.x += 1e-9;
    EXPECT_FALSE(is_same(first, source_of(copy)));
    copy.fixed[0].select.box->high.x -= 1e-9;
    copy.fixed[0].axes = {true, false, false};
    EXPECT_FALSE(is_same(first, source_of(copy))) << "it holds other axes";
  }
  EXPECT_GT(rounded, 5);
}

/// A copy near the origin, where coordinates have more digits, is cut as the copy far away is that
/// its cloud was made for.
TEST(Cuts, OfAFarBodyServeItsCopyNearby) {
  const Vec3d far{1e5 / 3, 2e5 / 7, 0};
  Scene scene = one_body();
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / fmt::format("cube_{}.stl", getpid());
  std::ofstream(file, std::ios::binary) << test::binary_stl(test::unit_cube());
  BodyRequest& body = scene.bodies[0];
  body.source.mesh = file;
  body.source.phyxels = 500;
  Selection select;
  select.box = Selection::Box{Vec3d{-1, -1, -1} + far, Vec3d{0.43, 2, 2} + far};
  body.translation = far;
  body.fixed = {{.select = select}};
  BodyRequest copy = body;
  copy.name = "copy";
  copy.translation = {};
  copy.fixed[0].select.box = Selection::Box{{-1, -1, -1}, {0.43, 2, 2}};
  scene.bodies.push_back(copy);
  for (const Cloud& cloud : make_clouds(scene, {})) EXPECT_EQ(cloud.cuts.list.size(), 1u);
  std::filesystem::remove(file);
}

/// Nothing is left to close in a body of which all is held.
TEST(Cuts, OfAWhollyHeldBodyAreNone) {
  const HeldCube cube = held_in({-1, -1, -1}, {2, 2, 2});
  EXPECT_TRUE(cube.model.warnings.empty()) << cube.model.warnings[0];
  EXPECT_EQ(cube.model.motions[0].phyxels.size(), 1000u);
}

}  // namespace
}  // namespace phyxel
