/// Planes of symmetry: parts of bodies that stand for the whole.
#include "model/symmetry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "phyxel/equilibrium.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/point_fields.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/folder.hpp"
#include "support/mesh_content.hpp"
#include "support/refusal.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class SymmetryOfMeshes : public test::Folder {};

constexpr Axes only_x{true, false, false}, only_y{false, true, false}, only_z{false, false, true};

/// A block with phyxels on its faces, from a corner `low`, under a tension along x at the end or
/// ends that `tension` names.
Scene block(Vec3d size, Vec3d middle, double spacing = 0.1) {
  Material material = rubber();
  material.law = "small-strain";
  material.hourglass = 0.1;
  Scene scene = one_body(material);
  BodyRequest& body = scene.bodies[0];
  body.source.shape = {.name = "block",
                       .size = size,
                       .spacing = spacing,
                       .placement = ShapeRequest::Placement::nodes};
  body.translation = middle;
  body.closure = 1e-12;
  return scene;
}
void pull(Scene& scene, Vec3d traction) {
  scene.bodies[0].tractions.push_back(
      {.select = {.all = true}, .traction = traction, .normal = traction, .angle = 1});
}
void cut_at_origin(Scene& scene) {
  scene.bodies[0].symmetries = {{PlaneNormal::x}, {PlaneNormal::y}, {PlaneNormal::z}};
}
State rest_of(const Model& model) {
  const auto backend = make_test_backend(model, Precision::double_);
  return find_equilibrium(model, *backend).state;
}

/// Three planes hold an eighth of a block as the whole holds itself, while its ends are drawn
/// apart.
TEST(Symmetry, AnEighthOfABlockMovesAsTheWholeDoes) {
  const auto draw = [](Scene& scene, const char* end, double distance) {
    scene.bodies[0].motions.push_back({.select = {.region = end},
                                       .displacement = {distance, 0, 0},
                                       .duration = 1,
                                       .axes = only_x});
  };
  Scene eighth = block({0.4, 0.3, 0.2}, {0.2, 0.15, 0.1});
  cut_at_origin(eighth);
  draw(eighth, "x+", 0.008);
  const Model part = build_model(eighth);
  EXPECT_THAT(part.warnings, IsEmpty());
  ASSERT_EQ(part.motions.size(), 4u);
  EXPECT_EQ(part.motions[2].set, "symmetry 2");
  EXPECT_EQ(part.motions[1].axes, only_x);
  EXPECT_EQ(part.motions[2].axes, only_y);
  EXPECT_EQ(part.motions[3].axes, only_z);
  EXPECT_EQ(part.motions[1].phyxels.size(), 4u * 3);
  EXPECT_EQ(part.motions[2].phyxels.size(), 5u * 3);
  EXPECT_EQ(part.motions[3].phyxels.size(), 5u * 4);

  Scene all = block({0.8, 0.6, 0.4}, {0, 0, 0});
  draw(all, "x+", 0.008);
  draw(all, "x-", -0.008);
  const auto middle = [](Vec3d half) { return Selection{.box = Selection::Box{-half, half}}; };
  all.bodies[0].fixed = {{middle({0.01, 1, 1}), only_x},
                         {middle({1, 0.01, 1}), only_y},
                         {middle({1, 1, 0.01}), only_z}};
  const Model whole = build_model(all);
  const State of_part = rest_of(part), of_whole = rest_of(whole);
  double largest = 0, worst = 0;
  int compared = 0;
  for (Index i = 0; i < part.size(); ++i) {
    for (Index j = 0; j < whole.size(); ++j) {
      if (norm(part.position[i] - whole.position[j]) > 1e-9) continue;
      largest = std::max(largest, norm(of_whole.displacement[j]));
      worst = std::max(worst, norm(of_part.displacement[i] - of_whole.displacement[j]));
      ++compared;
    }
  }
  EXPECT_EQ(compared, part.size());
  EXPECT_NEAR(largest, 0.02 * std::hypot(0.4, 0.3 * 0.3, 0.3 * 0.2),
              1e-9);  // 2%, and ν of it across
  EXPECT_LT(worst, 1e-7 * largest);
}

/// A clamped face that ends at planes keeps its phyxels along all axes, and a moved one those along
/// its own: no phyxel is held twice.
TEST(Symmetry, LeavesAxesToOtherEntries) {
  Scene scene = block({0.4, 0.4, 0.4}, {0.2, 0.2, 0.2});
  cut_at_origin(scene);
  BodyRequest& body = scene.bodies[0];
  body.fixed.push_back({.select = {.region = "x+"}});
  body.motions.push_back({.select = {.region = "y-"}, .velocity = {0, 1, 0}, .axes = only_y});
  EXPECT_THAT(refusal_of([&] { build_model(scene); }), HasSubstr("already fixed or moved"));
  body.motions[0].select = {.box = Selection::Box{{-1, -0.01, -1}, {0.35, 0.01, 1}}};
  const Model model = build_model(scene);
  std::vector<std::string> sets;
  for (const Motion& motion : model.motions) sets.push_back(motion.set);
  EXPECT_THAT(sets, ElementsAre("fixed 1", "motion 1", "symmetry 1", "symmetry 2", "symmetry 3"));
  std::vector<int> held(static_cast<std::size_t>(model.size()) * 3, 0);
  for (const Motion& motion : model.motions) {
    for (const Index i : motion.phyxels) {
      for (int k = 0; k < 3; ++k) held[3 * i + k] += motion.axes.bits() >> k & 1;
    }
  }
  EXPECT_THAT(held, ::testing::Each(::testing::Le(1)));
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d x = model.position[i];
    const bool clamped = x.x > 0.39;
    EXPECT_EQ(held[3 * i], clamped || x.x < 0.01);
    EXPECT_EQ(held[3 * i + 1], clamped || x.y < 0.01);
    EXPECT_EQ(held[3 * i + 2], clamped || x.z < 0.01);
  }
}

/// Bodies without phyxels on the plane are held by their outermost layer, and say so.
TEST(Symmetry, HoldsTheOutermostLayerOfBodiesWithoutPhyxelsOnThePlane) {
  Scene scene = block({0.4, 0.4, 0.4}, {0.2, 0.2, 0.2});
  scene.bodies[0].symmetries = {{PlaneNormal::z, 0.4}};
  scene.bodies[0].source.shape.placement = ShapeRequest::Placement::cells;
  const Model cells = build_model(scene);
  EXPECT_EQ(cells.motions[0].phyxels.size(), 16u);
  ASSERT_EQ(cells.warnings.size(), 1u);
  EXPECT_THAT(cells.warnings[0], HasSubstr("body \"body\", symmetry 1: no layer of phyxels lies on "
                                           "the plane z = 0.4 m; the 16 within"));
  // A cloud without a surface ends half a spacing beyond its phyxels.
  Scene bare = one_body();
  bare.bodies[0].symmetries = {{PlaneNormal::x, 0.4}};
  const Model model = model_of(bare, lattice(4, 5, 3, 0.1));
  EXPECT_EQ(model.motions[0].phyxels.size(), 15u);
  EXPECT_EQ(model.warnings.size(), 1u);
  bare.bodies[0].symmetries = {{PlaneNormal::x, 0.3}};
  EXPECT_THAT(refusal_of([&] { model_of(bare, lattice(4, 5, 3, 0.1)); }),
              HasSubstr("test.toml:1:1: key body.symmetry.at: the plane x = 0.3 m cuts the body, "
                        "which extends 0.25 m to x- and 0.05 m to x+ of it"));
}

/// A cube from a mesh, with phyxels on its faces, under a uniform stress.
TEST_F(SymmetryOfMeshes, HoldsABodyExactlyAtItsFaces) {
  const auto file = write("cube.obj", test::cube_vertices + test::cube_faces);
  Scene scene = block({1, 1, 1}, {0, 0, 0});
  BodyRequest& body = scene.bodies[0];
  body.source = {.mesh = file, .phyxels = 600};
  body.closure = 1e-6;
  cut_at_origin(scene);
  pull(scene, {20, 0, 0});  // a strain of 2e-4: Cauchy's stress is nearly the traction
  const Model model = build_model(scene);
  EXPECT_THAT(model.warnings, IsEmpty());
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(find_equilibrium(model, *backend).state);
  const Quantity stress = Quantity::stress;
  const std::vector<double> found =
      find_fields(model, *backend, {&stress, 1}, nullptr).at(Quantity::stress);
  double squares = 0, worst = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double off = std::abs(found[k] - (k % 6 == 0 ? 20 : 0)) / 20;
    worst = std::max(worst, off);
    squares += off * off / static_cast<double>(model.size());
  }
  EXPECT_LT(std::sqrt(squares), 1e-3);
  EXPECT_LT(worst, 5e-3);  // beside the edges of the loaded face
}

/// The surface of a part of a thick tube along z: from an angle of 0 to `turns` of a whole turn.
Surface tube(double inner, double outer, double length, double turns, int pieces) {
  Surface s;
  const bool is_whole = turns == 1;
  const int rings = is_whole ? pieces : pieces + 1;
  for (int k = 0; k < rings; ++k) {
    const double angle = 2 * std::numbers::pi * turns * k / pieces;
    Vec3d way{std::cos(angle), std::sin(angle), 0};
    if (turns == 0.25 && k == pieces) way = {0, 1, 0};
    for (const double z : {0.0, length}) {
      s.position.push_back(inner * way + Vec3d{0, 0, z});
      s.position.push_back(outer * way + Vec3d{0, 0, z});
    }
  }
  const auto quad = [&](Index a, Index b, Index c, Index d) {
    s.triangle.insert(s.triangle.end(), {{a, b, c}, {a, c, d}});
  };
  for (int k = 0; k < pieces; ++k) {  // 0 inner, 1 outer, 2 inner above, 3 outer above
    const Index a = 4 * k, b = 4 * ((k + 1) % rings);
    quad(a + 1, b + 1, b + 3, a + 3);
    quad(b, a, a + 2, b + 2);
    quad(b, b + 1, a + 1, a);
    quad(a + 2, a + 3, b + 3, b + 2);
  }
  if (!is_whole) {
    const Index e = 4 * pieces;
    quad(0, 1, 3, 2);
    quad(e + 1, e, e + 2, e + 3);
  }
  test::add_normals(s);
  return s;
}

/// A thick tube between smooth walls under a pressure inside (Lamé): the whole, and a quarter of
/// it between two planes more.
TEST(Symmetry, AQuarterOfATubeWidensAsTheWholeDoes) {
  const double inner = 0.5, outer = 1, length = 0.4, pressure = 2e3;
  const auto widening = [&](double turns, int pieces, Index phyxels) {
    Scene scene = block({1, 1, 1}, {0, 0, 0});
    BodyRequest& body = scene.bodies[0];
    body.source = {};
    body.closure = 1e-4;
    body.symmetries = {{PlaneNormal::z, 0}, {PlaneNormal::z, length}};
    if (turns < 1) {
      body.symmetries.push_back({PlaneNormal::x});
      body.symmetries.push_back({PlaneNormal::y});
    }
    const Surface surface = tube(inner, outer, length, turns, pieces);
    const Cloud cloud = sample_surface(surface, {.phyxels = phyxels, .on_surface = true});
    for (const double angle : {22.5, 67.5, 112.5, 157.5, 202.5, 247.5, 292.5, 337.5}) {
      if (angle > 360 * turns) break;
      const double radians = angle * std::numbers::pi / 180;
      body.tractions.push_back({.select = {.box = Selection::Box{{-0.6, -0.6, -1}, {0.6, 0.6, 1}}},
                                .pressure = pressure,
                                .normal = {-std::cos(radians), -std::sin(radians), 0},
                                .angle = 22.5});
    }
    const Model model = build_model(scene, std::span(&cloud, 1));
    EXPECT_THAT(model.warnings, IsEmpty());
    const State rest = rest_of(model);
    double sum = 0;
    int count = 0;
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d x = model.position[i], way = Vec3d{x.x, x.y, 0} / std::hypot(x.x, x.y);
      if (std::hypot(x.x, x.y) > 1.02 * inner) continue;
      sum += dot(rest.displacement[i], way);
      ++count;
    }
    EXPECT_GT(count, 20);
    return sum / count;
  };
  const double nu = 0.3, young = 1e5, a2 = inner * inner, b2 = outer * outer;
  const double expected =
      (1 + nu) / young * pressure * a2 / (b2 - a2) * ((1 - 2 * nu) * inner + b2 / inner);
  const double quarter = widening(0.25, 16, 700), whole = widening(1, 64, 2800);
  EXPECT_NEAR(quarter, expected, 0.03 * expected);
  EXPECT_NEAR(whole, expected, 0.03 * expected);
  EXPECT_NEAR(quarter, whole, 0.02 * expected);
}

/// A cube that is strongly graded towards the corner where three planes meet, under tension: the
/// layers of fine phyxels beside a plane are not taken for one.
TEST(Symmetry, HoldsTheFaceAloneOfAGradedBody) {
  Grading grading;
  grading.ratio = 10;
  grading.growth = 0.5;
  SpaceRegion corner;
  corner.is_ball = true;
  corner.radius = 0.15;
  grading.finer.push_back({corner, 10});
  const Cloud cloud = sample_surface(test::unit_cube(), {.phyxels = 2000, .grading = grading});
  Scene scene = block({1, 1, 1}, {0, 0, 0});
  scene.bodies[0].source = {};
  scene.bodies[0].closure = 1e-4;
  cut_at_origin(scene);
  pull(scene, {1000, 0, 0});
  const Model model = build_model(scene, std::span(&cloud, 1));
  EXPECT_THAT(model.warnings, IsEmpty());
  const State rest = rest_of(model);
  const double strain = 1000 / rubber().young;
  double worst = 0;
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d x = model.position[i],
                exact{strain * x.x, -0.3 * strain * x.y, -0.3 * strain * x.z};
    worst = std::max(worst, norm(rest.displacement[i] - exact));
  }
  // Areas of tractions differ by some percent from phyxel to phyxel.
  EXPECT_LT(worst, 5e-3 * strain);
}

}  // namespace
}  // namespace phyxel
