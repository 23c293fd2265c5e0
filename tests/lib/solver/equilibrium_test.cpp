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

/// Reference: `bar_5` of bench/references, known within 1.2e-5. Seen: 1.2% and 0.3% by its weight,
/// 0.4% by a force.
TEST(Equilibrium, ABarSagsAsFiniteElementsSay) {
  for (const auto& [across, tolerance] : {std::pair{4, 0.02}, {6, 0.01}}) {
    Scene scene = clamped_bar(across);
    scene.gravity = {0, 0, -0.1};
    const Model model = build_model(scene);
    const Equilibrium found = rest_of(model);
    EXPECT_LE(found.residual, 1e-8);
    EXPECT_NEAR(mean_of_end(model, found.state), -3.83983e-03, tolerance * 3.83983e-03);
  }
}

TEST(Equilibrium, ABarUnderShearBendsAsFiniteElementsSay) {
  Scene scene = clamped_bar(6);
  scene.bodies[0].loads.push_back({.select = {.region = "x+"}, .force = {0, 0, -1}});
  const Model model = build_model(scene);
  const Equilibrium found = rest_of(model);
  EXPECT_NEAR(mean_of_end(model, found.state), -2.544058e-03, 0.01 * 2.544058e-03);
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

std::string refusal_of(const Model& model) {
  try {
    rest_of(model);
  } catch (const InputError& error) {
    return error.what();
  }
  return "found";
}

/// Of two bodies one is held: the other one falls, which is said before a force is evaluated.
TEST(Equilibrium, NamesTheOneBodyThatNothingHolds) {
  Scene scene = clamped_bar(2);
  scene.gravity = {0, 0, -1};
  scene.bodies.push_back(scene.bodies[0]);
  scene.bodies[1].name = "other";
  scene.bodies[1].fixed.clear();
  EXPECT_THAT(refusal_of(build_model(scene)),
              HasSubstr("body \"other\": nothing is held against a force of"));
  // Held along z alone, it is held against its weight, but not against a push along x.
  scene.bodies[1].fixed.push_back(
      {.select = {.region = "x-"}, .axes = {.x = false, .y = false, .z = true}});
  scene.bodies[1].fixed.push_back(
      {.select = {.region = "x+"}, .axes = {.x = false, .y = false, .z = true}});
  EXPECT_EQ(refusal_of(build_model(scene)), "found");
  scene.bodies[1].loads.push_back({.select = {.all = true}, .force = {1, 0, 0}});
  EXPECT_THAT(refusal_of(build_model(scene)), HasSubstr("against a force of 1 N along x"));
}

/// Held along a line, a bar can turn about it, and its weight turns it.
TEST(Equilibrium, NamesTheAxisThatAHingeLetsABodyTurnAbout) {
  Scene scene = clamped_bar(2);
  scene.gravity = {0, 0, -1};
  scene.bodies[0].fixed = {{.select = {.box = Selection::Box{{-1, -1, -0.11}, {0.01, 1, -0.09}}}}};
  const Model model = build_model(scene);
  const std::string why = refusal_of(model);
  EXPECT_THAT(why, HasSubstr("body \"bar\": nothing is held against a torque of"));
  EXPECT_THAT(why, ::testing::AnyOf(HasSubstr("along (0, 1, 0)"), HasSubstr("along (0, -1, 0)"),
                                    HasSubstr("along (-0, 1, 0)"), HasSubstr("along (-0, -1, -0)"),
                                    HasSubstr("along (0, -1, -0)"), HasSubstr("along (-0, 1, -0)"),
                                    HasSubstr("along (0, 1, -0)"), HasSubstr("along (-0, -1, 0)")));
}

/// Loads that cancel need no support: a free bar is stretched, and one without loads stays.
TEST(Equilibrium, OfAFreeBodyIsFoundWhereItsLoadsCancel) {
  Scene scene = clamped_bar(2);
  scene.bodies[0].fixed.clear();
  EXPECT_EQ(rest_of(build_model(scene)).steps, 0);
  scene.bodies[0].loads.push_back({.select = {.region = "x-"}, .force = {-20, 0, 0}});
  scene.bodies[0].loads.push_back({.select = {.region = "x+"}, .force = {20, 0, 0}});
  const Model model = build_model(scene);
  const Equilibrium found = rest_of(model);
  EXPECT_LE(found.residual, 1e-8);
  double longer = 0;
  for (const Vec3d& u : found.state.displacement) longer = std::max(longer, 2 * u.x);
  // σ L / E = 20 N / 0.04 m² / 1 MPa; two phyxels across: a fifth.
  EXPECT_NEAR(longer, 5e-4, 1e-4);
}

/// A part of a body out of reach of the rest falls for ever, which no look at bodies shows: the
/// search ends, and says what it was doing and how far it had come.
TEST(Equilibrium, OfABodyInTwoPiecesEndsWithItsResidual) {
  Scene scene = one_body();
  scene.gravity = {0, 0, -1};
  scene.bodies[0].material.hourglass = 0.1;
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {0.1, 1, 1}}}});
  Cloud cloud = lattice(4, 3, 3, 0.1);
  for (const Vec3d& x : lattice(3, 3, 3, 0.1).position) {
    cloud.position.push_back(x + Vec3d{5, 0, 0});
    cloud.volume.push_back(1e-3);
  }
  scene.bodies[0].neighbourhood.radius = 0.18;
  const Model model = model_of(scene, cloud);
  try {
    rest_of(model);
    FAIL() << "a falling piece was called at rest";
  } catch (const DivergedError& error) {
    EXPECT_THAT(error.what(), HasSubstr("steps of Newton's method"));
    EXPECT_THAT(error.what(), HasSubstr("evaluations of the forces"));
    EXPECT_THAT(error.what(), HasSubstr("1e-08 is needed"));
  }
}

/// Stopped at any iteration, a search goes on from the last accepted step to the same bits; the
/// observer has seen the residual fall below the tolerance that it was told of.
TEST(Equilibrium, GoesOnToTheBitAfterItWasStopped) {
  Scene scene = clamped_bar(2);
  scene.gravity = {0, 0, -2};
  scene.bodies[0].motions.push_back(
      {.select = {.region = "x+"}, .rotation = {120, 0, 0}, .about = {1, 0, 0}, .duration = 1});
  const Model model = build_model(scene);
  const Equilibrium whole = rest_of(model);
  int calls = 0;
  const auto backend = make_test_backend(model, Precision::double_);
  find_equilibrium(model, *backend, {.observer = [&](const NewtonProgress& now) {
                     EXPECT_TRUE(now.tolerance == 1e-8 || now.tolerance == 1e-2);
                     EXPECT_GE(now.residual, 0);
                     ++calls;
                     return true;
                   }});
  ASSERT_GT(calls, 100);
  EXPECT_LE(calls, whole.evaluations);
  for (const double share : {0.01, 0.3, 0.5, 0.8, 0.99}) {
    const auto stopped = make_test_backend(model, Precision::double_);
    int left = static_cast<int>(share * calls);
    EXPECT_THROW(find_equilibrium(model, *stopped,
                                  {.observer = [&](const NewtonProgress&) { return --left > 0; }}),
                 InterruptedError);
    EXPECT_EQ(left, 0);  // at once
    State middle;
    stopped->download(middle);
    const Equilibrium rest = find_equilibrium(model, *stopped, {.start = &middle.displacement});
    EXPECT_TRUE(rest.state.displacement == whole.state.displacement) << share;
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
