/// Equilibria against known answers.
#include "phyxel/equilibrium.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

/// The bar of the converged finite elements: 1 m by 0.2 m by 0.2 m, one end clamped.
Scene clamped_bar(int across) {
  Scene scene;
  BodyRequest bar;
  bar.name = "bar";
  bar.where = "test";
  bar.source.shape = {.name = "beam",
                      .size = {1, 0.2, 0.2},
                      .spacing = 0.2 / across,
                      .placement = ShapeRequest::Placement::nodes,
                      .surface = false};
  bar.material = {.young = 1e6, .poisson = 0.3, .density = 1000, .hourglass = 0.3};
  bar.fixed.push_back({.select = {.region = "x-"}});
  scene.bodies.push_back(bar);
  return scene;
}

/// Along z, by the area that each phyxel of the end has [m].
double mean_of_end(const Model& model, const State& state) {
  double sum = 0, volume = 0;
  for (Index i = 0; i < model.size(); ++i) {
    if (model.position[i].x < 1 - 1e-9) continue;
    sum += model.volume[i] * state.displacement[i].z;
    volume += model.volume[i];
  }
  return sum / volume;
}

Equilibrium rest_of(const Model& model) {
  const auto backend = make_test_backend(model, Precision::double_);
  return find_equilibrium(model, *backend);
}

/// Reference: quadratic 20-node bricks on 40 x 8 x 8, which differ by 0.2% from 20 x 4 x 4. Seen:
/// 1.3% and 0.4%.
TEST(Equilibrium, ABarSagsAsFiniteElementsSay) {
  for (const auto& [across, tolerance] : {std::pair{4, 0.02}, {6, 0.01}}) {
    Scene scene = clamped_bar(across);
    scene.gravity = {0, 0, -0.1};
    const Model model = build_model(scene);
    const Equilibrium found = rest_of(model);
    EXPECT_LE(found.residual, 1e-8);
    EXPECT_NEAR(mean_of_end(model, found.state), -3.834952e-03, tolerance * 3.834952e-03);
  }
}

TEST(Equilibrium, ABarUnderShearBendsAsFiniteElementsSay) {
  Scene scene = clamped_bar(6);
  scene.bodies[0].loads.push_back({.select = {.region = "x+"}, .force = {0, 0, -1}});
  const Model model = build_model(scene);
  const Equilibrium found = rest_of(model);
  EXPECT_NEAR(mean_of_end(model, found.state), -2.541718e-03, 0.01 * 2.541718e-03);
}

/// A bar whose ends are moved alike is moved as a whole, by motions that end there.
TEST(Equilibrium, FollowsMotionsToTheirEnds) {
  Scene scene = clamped_bar(4);
  scene.bodies[0].fixed.clear();
  scene.bodies[0].motions.push_back(
      {.select = {.region = "x-"}, .displacement = {0, 0.01, 0}, .duration = 1});
  scene.bodies[0].motions.push_back(
      {.select = {.region = "x+"}, .displacement = {0, 0.01, 0}, .duration = 1});
  const Model model = build_model(scene);
  const Equilibrium found = rest_of(model);
  for (Index i = 0; i < model.size(); ++i) {
    EXPECT_LT(norm(found.state.displacement[i] - Vec3d{0, 0.01, 0}), 1e-9);
  }
}

/// A thin bar, bent far: the elastica of a clamped end under an end load, whose shape is known
/// (Bisshopp and Drucker 1945): F L² / (E I) = 2 moves the end by 0.4935 L down and 0.1606 L back.
TEST(Equilibrium, AThinBarBendsAsTheElasticaDoes) {
  constexpr double length = 2, height = 0.1;
  Scene scene;
  BodyRequest bar;
  bar.name = "bar";
  bar.where = "test";
  bar.source.shape = {.name = "beam",
                      .size = {length, height, height},
                      .spacing = height / 4,
                      .placement = ShapeRequest::Placement::nodes,
                      .surface = false};
  bar.material = {.young = 1e6, .poisson = 0, .density = 1000, .hourglass = 0.3};
  bar.fixed.push_back({.select = {.region = "x-"}});
  const double inertia = std::pow(height, 4) / 12;
  const double force = 2 * bar.material.young * inertia / (length * length);
  bar.loads.push_back({.select = {.region = "x+"}, .force = {0, 0, -force}});
  scene.bodies.push_back(bar);
  const Model model = build_model(scene);
  const Equilibrium found = rest_of(model);
  double down = 0, back = 0, volume = 0;
  for (Index i = 0; i < model.size(); ++i) {
    if (model.position[i].x < length - 1e-9) continue;
    down -= model.volume[i] * found.state.displacement[i].z;
    back -= model.volume[i] * found.state.displacement[i].x;
    volume += model.volume[i];
  }
  // Four across are 1.3% too soft (see above), which shows twice in what goes by the square; shear
  // and stretch, which the elastica leaves out, are 0.3%. Seen: 1.5% and 3.4%.
  EXPECT_NEAR(down / volume / length, 0.4935, 0.02 * 0.4935);
  EXPECT_NEAR(back / volume / length, 0.1606, 0.04 * 0.1606);
}

/// A bar of two materials end to end, pulled: both take the same force, so that the softer one
/// stretches by as much more as it is softer: by a tenth, or a million times.
TEST(Equilibrium, OfTwoMaterialsInARowBothTakeTheForce) {
  for (const double contrast : {10.0, 1e6}) {
    Scene scene;
    BodyRequest bar;
    bar.name = "bar";
    bar.where = "test";
    bar.source.shape = {.name = "beam",
                        .size = {1.6, 0.4, 0.4},
                        .spacing = 0.1,
                        .placement = ShapeRequest::Placement::nodes,
                        .surface = true};
    bar.material = {.young = 1e6, .poisson = 0, .density = 1000, .hourglass = 0.1};
    bar.closure = 1e-6;
    Material hard = bar.material;
    hard.young *= contrast;
    bar.inclusions.push_back(
        {.select = {.box = Selection::Box{{0.81, -1, -1}, {2, 1, 1}}}, .material = hard});
    bar.fixed.push_back({.select = {.region = "x-"}});
    bar.motions.push_back(
        {.select = {.region = "x+"}, .displacement = {8e-6, 0, 0}, .duration = 1});
    scene.bodies.push_back(bar);
    const Model model = build_model(scene);
    ASSERT_EQ(model.parts.size(), 2u);
    const auto backend = make_test_backend(model, Precision::double_);
    const State rest = find_equilibrium(model, *backend).state;
    double joint = 0, joined = 0;
    for (Index i = 0; i < model.size(); ++i) {
      if (std::abs(model.position[i].x - 0.8) > 1e-9) continue;
      joint += rest.displacement[i].x;
      ++joined;
    }
    // The joint is blurred over a support: 5% of the length of a half. Seen: 0.4% and 0.1%.
    const double expected = 8e-6 * contrast / (1 + contrast);
    EXPECT_NEAR(joint / joined, expected, 0.02 * expected);
  }
}

TEST(Equilibrium, IsRefusedWhereNothingHoldsTheBody) {
  Scene scene = clamped_bar(2);
  scene.bodies[0].fixed.clear();
  scene.gravity = {0, 0, -1};
  const Model model = build_model(scene);
  try {
    rest_of(model);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nothing is held against a force of"));
  }
}

TEST(Equilibrium, OfAMotionThatNeverEndsIsRefused) {
  Scene scene = clamped_bar(2);
  scene.bodies[0].motions.push_back({.select = {.region = "x+"}, .velocity = {1, 0, 0}});
  const Model model = build_model(scene);
  EXPECT_THROW(rest_of(model), InputError);
}

}  // namespace
}  // namespace phyxel
