/// Readings at points and over regions.
#include "phyxel/probes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "model/point_fit.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/point_fields.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/refusal.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

Probe at(std::vector<Vec3d> points, const char* body = "body") {
  return {.name = "some", .body = body, .points = std::move(points)};
}

std::vector<Vec3d> bent(const std::vector<Vec3d>& position) {
  std::vector<Vec3d> u;
  for (const Vec3d x : position) {
    u.push_back({1e-3 * x.x * x.y, 2e-3 * x.x * x.x - 1e-3 * x.z, 1e-3 * x.y * x.z + 1e-3});
  }
  return u;
}

/// Shares reproduce quadratic polynomials wherever the phyxels tell their terms apart.
TEST(PointFit, ReproducesQuadraticPolynomials) {
  const Cloud cloud = lattice(4, 4, 4, 0.1, 0.3);
  const auto f = [](Vec3d x) { return 1 + x.x - 2 * x.y + x.x * x.y + 3 * x.z * x.z - x.y * x.z; };
  for (const Vec3d point : {Vec3d{0.2, 0.2, 0.2}, Vec3d{0, 0.1, 0.4}, Vec3d{0.4, 0.4, 0.4}}) {
    const std::vector<double> share = shares_at(point, cloud.position, 0.7);
    double value = 0;
    for (std::size_t k = 0; k < share.size(); ++k) value += share[k] * f(cloud.position[k]);
    EXPECT_NEAR(value, f(point), 1e-12);
  }
}

/// In one layer, in two, of three phyxels and of one: constants stay, and what is not seen plays no
/// part.
TEST(PointFit, KnowsWhatPhyxelsDoNotTell) {
  for (const int layers : {1, 2}) {
    const Cloud cloud = lattice(6, 6, layers, 0.1);
    const Vec3d point{0.3, 0.31, 0.05 * layers + 0.02};
    const std::vector<double> share = shares_at(point, cloud.position, 0.5);
    double one = 0, square = 0, height = 0;
    for (std::size_t k = 0; k < share.size(); ++k) {
      const Vec3d x = cloud.position[k];
      one += share[k];
      square += share[k] * x.x * x.x;
      height += share[k] * x.z;
    }
    EXPECT_NEAR(one, 1, 1e-13);
    EXPECT_NEAR(square, 0.09, 1e-12);
    EXPECT_NEAR(height, layers == 1 ? 0.05 : 0.12, 1e-12);
  }
  const std::vector<Vec3d> few = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<double> share = shares_at({0.2, 0.3, 0}, few, 3);
  EXPECT_NEAR(share[1], 0.2, 1e-12);
  EXPECT_NEAR(share[2], 0.3, 1e-12);
  const std::vector<Vec3d> one = {{1, 2, 3}};
  EXPECT_EQ(shares_at({1, 2, 3}, one, 0), std::vector<double>{1});
  EXPECT_EQ(shares_at({1, 2, 3.1}, one, 0.05), std::vector<double>{1});
}

/// A quadratic displacement and a linear stress are read without error at every point.
TEST(Probes, AreExactForQuadraticDisplacements) {
  const Cloud cloud = lattice(9, 8, 8, 0.1);
  Material material = rubber();
  material.law = "small-strain";
  const Scene scene = one_body(material);
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(bent(model.position)));
  // In the middle, three supports from the surface; and displacements at a corner, an edge, a face.
  const std::vector<Vec3d> points = {
      {0.44, 0.41, 0.38}, {0.05, 0.05, 0.05}, {0.5, 0.02, 0.02}, {0.5, 0.4, 0.77}};
  const std::vector<ProbeReading> found = Probes(model, {at(points)}).read(*backend);
  ASSERT_EQ(found.size(), points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    EXPECT_EQ(found[k].number, static_cast<Index>(k));
    EXPECT_EQ(found[k].place, points[k]);
    // The corner has too few neighbours for a quadratic polynomial: second derivatives of 4e-3 over
    // a tenth of a metre.
    EXPECT_LT(norm(found[k].displacement - bent({points[k]})[0]), k == 1 ? 2e-5 : 1e-14);
  }
  const Vec3d x = points[0];
  const double xx = 1e-3 * x.y, xy = 0.5 * (1e-3 * x.x + 4e-3 * x.x), zz = 1e-3 * x.y;
  const double mu = material.lame_mu(), lambda = material.lame_lambda();
  // The stress is Cauchy's, P Fᵀ / det F: gradients of 5e-3 beside one.
  const double off = 0.02 * mu * 5e-3;
  EXPECT_NEAR(found[0].stress[0], 2 * mu * xx + lambda * (xx + zz), off);
  EXPECT_NEAR(found[0].stress[3], 2 * mu * xy, off);
  EXPECT_NEAR(found[0].strain[3], xy, 2e-5);  // Green's
}

/// Over a region, values are means by volume of those of phyxels.
TEST(Probes, AverageOverRegions) {
  const Cloud cloud = lattice(6, 4, 4, 0.1, 0.2);
  Scene scene = one_body();
  Selection half;
  half.box = Selection::Box{{0.3, -1, -1}, {1, 1, 1}};
  scene.bodies[0].probes = {{.name = "half", .select = half},
                            {.name = "corner", .points = {{0, 0, 0}}}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  ASSERT_EQ(model.probes.size(), 2u);
  const auto backend = make_test_backend(model, Precision::double_);
  State state = state_of(bent(model.position));
  for (std::size_t i = 0; i < state.velocity.size(); ++i) {
    state.velocity[i] = {1, 2, static_cast<double>(i)};
  }
  backend->upload(state);
  const std::vector<ProbeReading> found = Probes(model).read(*backend);
  ASSERT_EQ(found.size(), 2u);
  const Quantity wanted[] = {Quantity::stress};
  const FieldValues fields = find_fields(model, *backend, wanted);
  double volume = 0, stress = 0;
  Vec3d place, velocity;
  for (Index i = 0; i < model.size(); ++i) {
    if (model.position[i].x < 0.3) continue;
    volume += model.volume[i];
    place += model.volume[i] * model.position[i];
    velocity += model.volume[i] * state.velocity[i];
    stress += model.volume[i] * fields.at(Quantity::stress)[6 * i + 3];
  }
  EXPECT_EQ(found[0].probe, "half");
  EXPECT_LT(norm(found[0].place - place / volume), 1e-14);
  EXPECT_LT(norm(found[0].velocity - velocity / volume), 1e-11);
  EXPECT_NEAR(found[0].stress[3], stress / volume, 1e-12 * model.parts[0].material.young);
  EXPECT_EQ(found[1].probe, "corner");
}

/// Beside a clamp and at an interface, where the strain jumps, a point has the displacement of its
/// own side; and across a gap wider than a support it knows of nothing.
TEST(Probes, StayOnTheirSide) {
  Cloud cloud = lattice(12, 5, 5, 0.1);
  Scene scene = one_body();
  Selection half;
  half.box = Selection::Box{{0.6, -1, -1}, {2, 1, 1}};
  scene.bodies[0].inclusions = {{.select = half, .material = scene.bodies[0].material}};
  Model model = build_model(scene, std::span(&cloud, 1));
  const auto kinked = [](const Model& of, double kink) {
    std::vector<Vec3d> u;
    for (const Vec3d x : of.position) u.push_back({std::max(0.0, x.x - kink), 0, 0});
    return state_of(u);
  };
  auto backend = make_test_backend(model, Precision::double_);
  backend->upload(kinked(model, 0.6));
  const auto u_at = [&](double x) {
    return Probes(model, {at({{x, 0.2, 0.2}})}).read(*backend)[0].displacement.x;
  };
  EXPECT_NEAR(u_at(0.58), 0, 1e-14);
  EXPECT_NEAR(u_at(0.62), 0.02, 1e-14);
  // A wall in the second material: a support up to x = 0.9.
  SpaceRegion support;
  support.low = {-9, -9, -9};
  support.high = {0.9, 9, 9};
  model.walls = {Walls{.regions = {support}, .depth = 1e-12, .spacing = 0.1}};
  backend->upload(kinked(model, 0.9));
  EXPECT_NEAR(u_at(0.88), 0, 1e-14);
  EXPECT_NEAR(u_at(0.92), 0.02, 1e-14);

  for (Vec3d& x : cloud.position) x.x += x.x > 0.6 ? 0.3 : 0;
  const Model gaping = build_model(one_body(), std::span(&cloud, 1));
  const auto of_gap = make_test_backend(gaping, Precision::double_);
  std::vector<Vec3d> apart;
  for (const Vec3d x : gaping.position) apart.push_back({x.x > 0.7 ? 1.0 : 0.0, 0, 0});
  of_gap->upload(state_of(apart));
  EXPECT_EQ(Probes(gaping, {at({{0.55, 0.2, 0.2}})}).read(*of_gap)[0].displacement.x, 0);
}

TEST(Probes, OutsideAreRefused) {
  const Cloud cloud = lattice(4, 4, 4, 0.1);
  const Model model = build_model(one_body(), std::span(&cloud, 1));
  EXPECT_THAT(refusal_of([&] {
                Probes(model, {at({{0.2, 0.2, 0.2}, {0.2, 0.2, 0.47}})});
              }),
              HasSubstr("probe \"some\": point [0.2, 0.2, 0.47] is 0.139 m from the nearest phyxel "
                        "of body \"body\"; allowed: at most 0.115 m, half its support"));
  EXPECT_THAT(refusal_of([&] {
                Probes(model, {at({{0.2, 0.2, 0.2}}, "cow")});
              }),
              HasSubstr("body \"cow\""));
  EXPECT_TRUE(Probes(model).empty());
}

}  // namespace
}  // namespace phyxel
