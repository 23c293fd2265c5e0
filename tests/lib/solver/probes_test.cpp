/// Readings at points and over regions.
#include "phyxel/probes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/point_fields.hpp"
#include "solver/point_fit.hpp"
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

/// Shares of a fit reproduce quadratic polynomials wherever the phyxels tell their terms apart.
TEST(PointFit, ReproducesQuadraticPolynomials) {
  const Cloud cloud = lattice(4, 4, 4, 0.1, 0.3);
  const auto f = [](Vec3d x) { return 1 + x.x - 2 * x.y + x.x * x.y + 3 * x.z * x.z - x.y * x.z; };
  const auto slope = [](Vec3d x) { return Vec3d{1 + x.y, -2 + x.x - x.z, 6 * x.z - x.y}; };
  for (const Vec3d point : {Vec3d{0.2, 0.2, 0.2}, Vec3d{0, 0.1, 0.4}, Vec3d{0.4, 0.4, 0.4}}) {
    const PointFit fit = fit_at(point, cloud.position, 0.7);
    double value = 0;
    Vec3d gradient;
    for (std::size_t k = 0; k < cloud.position.size(); ++k) {
      value += fit.value[k] * f(cloud.position[k]);
      gradient += f(cloud.position[k]) * fit.gradient[k];
    }
    EXPECT_NEAR(value, f(point), 1e-12);
    EXPECT_LT(norm(gradient - slope(point)), 1e-10);
  }
}

/// In one layer, in two, and of three phyxels: constants stay, and what is not seen has no slope.
TEST(PointFit, KnowsWhatPhyxelsDoNotTell) {
  for (const int layers : {1, 2}) {
    const Cloud cloud = lattice(6, 6, layers, 0.1);
    const Vec3d point{0.3, 0.31, 0.05 * layers};
    const PointFit fit = fit_at(point, cloud.position, 0.5);
    double one = 0, square = 0;
    Vec3d gradient, of_height;
    for (std::size_t k = 0; k < cloud.position.size(); ++k) {
      const Vec3d x = cloud.position[k];
      one += fit.value[k];
      square += fit.value[k] * x.x * x.x;
      gradient += fit.gradient[k];
      of_height += x.z * fit.gradient[k];
    }
    EXPECT_NEAR(one, 1, 1e-13);
    EXPECT_NEAR(square, 0.09, 1e-12);
    EXPECT_LT(norm(gradient), 1e-11);
    EXPECT_LT(norm(of_height - Vec3d{0, 0, layers == 1 ? 0.0 : 1.0}), 1e-11);
  }
  const std::vector<Vec3d> few = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const PointFit fit = fit_at({0.2, 0.3, 0}, few, 3);
  EXPECT_NEAR(fit.value[1], 0.2, 1e-12);
  EXPECT_NEAR(fit.value[2], 0.3, 1e-12);
}

/// A quadratic displacement is read without error at every point, corners of a mesh included, and
/// stresses are Hooke's.
TEST(Probes, AreExactForQuadraticDisplacements) {
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.4, 0.5}), {.phyxels = 1000});
  Material material = rubber();
  material.law = "small-strain";
  const Scene scene = one_body(material);
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(bent(model.position)));
  const std::vector<Vec3d> points = {{0, 0, 0}, {1, 0.4, 0.5}, {0.5, 0, 0.2}, {0.41, 0.23, 0.3}};
  const std::vector<ProbeReading> found = Probes(model, {at(points)}).read(*backend);
  ASSERT_EQ(found.size(), points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vec3d x = points[k];
    EXPECT_EQ(found[k].number, static_cast<Index>(k));
    EXPECT_LT(norm(found[k].displacement - bent({x})[0]), 1e-14);
    const double xx = 1e-3 * x.y, xy = 0.5 * (1e-3 * x.x + 4e-3 * x.x), zz = 1e-3 * x.y,
                 yz = 0.5 * (1e-3 * x.z - 1e-3);
    const double mu = material.lame_mu(), lambda = material.lame_lambda();
    // The stress is Cauchy's, of P Fᵀ / det F: gradients of 5e-3 beside one.
    const double off = 0.02 * mu * 5e-3;
    EXPECT_NEAR(found[k].stress[0], 2 * mu * xx + lambda * (xx + zz), off);
    EXPECT_NEAR(found[k].stress[3], 2 * mu * xy, off);
    EXPECT_NEAR(found[k].stress[4], 2 * mu * yz, off);
    EXPECT_NEAR(found[k].strain[3], xy, 5e-5);  // Green's
  }
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

/// Beside a clamp whose strain jumps to zero, and at an interface, a point has the values of its
/// own side.
TEST(Probes, StayOnTheirSide) {
  const Cloud cloud = lattice(12, 5, 5, 0.1);
  Scene scene = one_body();
  Selection half;
  half.box = Selection::Box{{0.6, -1, -1}, {2, 1, 1}};
  Material stiff = scene.bodies[0].material;
  stiff.young *= 10;
  scene.bodies[0].inclusions = {{.select = half, .material = stiff}};
  Model model = build_model(scene, std::span(&cloud, 1));
  const auto kinked = [&](double kink) {
    std::vector<Vec3d> u;
    for (const Vec3d x : model.position) u.push_back({1e-3 * std::max(0.0, x.x - kink), 0, 0});
    return state_of(u);
  };
  auto backend = make_test_backend(model, Precision::double_);
  backend->upload(kinked(0.6));
  const auto strain_at = [&](double x) {
    return Probes(model, {at({{x, 0.2, 0.2}})}).read(*backend)[0].strain[0];
  };
  EXPECT_NEAR(strain_at(0.58), 0, 1e-14);
  EXPECT_NEAR(strain_at(0.62), 1e-3, 1e-6);
  // A wall in the second material: a support up to x = 0.9.
  SpaceRegion support;
  support.low = {-9, -9, -9};
  support.high = {0.9, 9, 9};
  model.walls = {Walls{.regions = {support}, .depth = 1e-12, .spacing = 0.1}};
  backend->upload(kinked(0.9));
  EXPECT_NEAR(strain_at(0.88), 0, 1e-14);
  EXPECT_NEAR(strain_at(0.92), 1e-3, 1e-6);
}

/// The stress of a law that remembers is fitted: a quadratic field of it is read without error.
TEST(Probes, FitTheStressOfLawsWithHistory) {
  const Cloud cloud = lattice(8, 6, 6, 0.1);
  Material material = rubber();
  material.viscosity = 1e-3;
  const Scene scene = one_body(material);
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  State state = state_of(bent(model.position));
  backend->upload(state);
  const Quantity wanted[] = {Quantity::stress};
  const FieldValues fields = find_fields(model, *backend, wanted);
  const Vec3d inside{0.4, 0.3, 0.3};
  const ProbeReading found = Probes(model, {at({inside})}).read(*backend)[0];
  double nearest = HUGE_VAL, stress = 0;
  for (Index i = 0; i < model.size(); ++i) {
    const double distance = norm(model.position[i] - inside);
    if (distance < nearest) {
      nearest = distance;
      stress = fields.at(Quantity::stress)[6 * i + 3];
    }
  }
  // Phyxels are 0.05 away along each axis, where the shear stress differs by an eighth.
  EXPECT_NEAR(found.stress[3], stress, 0.2 * std::abs(stress));
  EXPECT_GT(std::abs(stress), 1);
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
