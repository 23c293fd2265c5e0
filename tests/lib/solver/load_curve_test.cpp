/// Loads along curves, on the CPU and in programs built with PHYXEL_TEST_CUDA on a GPU.
#include "phyxel/load_curve.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/refusal.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using Points = std::vector<LoadCurve::Point>;

TEST(LoadCurve, IsLinearBetweenPointsAndConstantBeyondThem) {
  const LoadCurve curve{{{1, 2}, {3, -2}, {4, 0}}};
  for (const auto& [time, factor] : Points{{-1, 2},
                                           {0, 2},
                                           {1, 2},
                                           {1.5, 1},
                                           {2, 0},
                                           {3, -2},
                                           {3.25, -1.5},
                                           {4, 0},
                                           {9, 0},
                                           {HUGE_VAL, 0}}) {
    EXPECT_EQ(curve.at(time), factor) << time;
  }
  EXPECT_FALSE(curve.is_constant());
  EXPECT_EQ(curve.largest(), 2);
  EXPECT_EQ(curve.shortest_rise(), 2);  // a range of 4, in pieces of slopes -2 and 2
  const LoadCurve steady{{{1, -3}}};
  EXPECT_EQ(steady.at(0), -3);
  EXPECT_TRUE(steady.is_constant());
  EXPECT_EQ(steady.shortest_rise(), HUGE_VAL);
  EXPECT_EQ(LoadCurve{}.at(7), 1);
}

/// A run with a ramp keeps the bits that it had when a ramp was a quotient.
TEST(LoadCurve, OfARampIsTimeOverItsDurationToTheBit) {
  for (const double ramp : {0.3, 7.0, 1e-7}) {
    const LoadCurve curve = LoadCurve::of(ramp, {});
    EXPECT_EQ(curve.shortest_rise(), ramp);
    for (int k = 0; k <= 300; ++k) {
      const double time = ramp * k / 200;
      EXPECT_EQ(curve.at(time), time < ramp ? time / ramp : 1) << time;
    }
  }
  EXPECT_TRUE(LoadCurve::of(0, {}).is_constant());
}

/// A block of 0.2 × 0.2 × 0.6 m with its surface, clamped at its end, and a load on the other.
Scene loaded_block(const std::string& kind, const Points& curve, double factor = 1) {
  Material material = rubber();
  material.hourglass = 0.1;
  Scene scene = one_body(material);
  BodyRequest& body = scene.bodies[0];
  body.source.shape = {.name = "block", .size = {0.2, 0.2, 0.6}, .spacing = 0.1};
  body.fixed.push_back({.select = {.region = "z-"}});
  const Selection end{.box = Selection::Box{{-1, -1, 0.29}, {1, 1, 1}}};
  if (kind == "load") {
    body.loads.push_back(
        {.select = {.region = "z+"}, .force = factor * Vec3d{4, 0, 10}, .curve = curve});
  } else if (kind == "traction") {
    body.tractions.push_back(
        {.select = end, .traction = factor * Vec3d{0, 100, 300}, .curve = curve});
  } else {
    body.tractions.push_back(
        {.select = end, .pressure = factor * 300, .follower = true, .curve = curve});
  }
  return scene;
}

/// A load that goes up, down and to the other side, so slowly that inertia plays no part: the body
/// passes through the states of rest under the shares of the load that act then.
TEST(LoadCurve, BodiesFollowSlowCurvesThroughStatesOfRest) {
  const Points curve{{0, 0}, {100, 1}, {200, 0.25}, {400, -1}};
  for (const std::string kind : {"load", "traction", "follower"}) {
    Scene scene = loaded_block(kind, curve);
    scene.solver.method = Method::implicit;
    const Model model = build_model(scene);
    const auto backend = make_test_backend(model, Precision::double_);
    Solver solver(model, *backend, initial_state(model, scene, 10), Method::implicit);
    // The method "equilibrium" takes the last factor.
    Scene last = loaded_block(kind, curve);
    for (const auto& [time, factor] : Points{{100, 1}, {200, 0.25}, {300, -0.375}, {400, -1}}) {
      while (solver.time() < time - 1e-9) solver.step();
      const Scene under = time < 400 ? loaded_block(kind, {}, factor) : last;
      const Model same = build_model(under);
      const auto rest_backend = make_test_backend(same, Precision::double_);
      const State rest = find_equilibrium(same, *rest_backend).state;
      const State state = solver.state();
      double largest = 0, difference = 0;
      for (std::size_t i = 0; i < rest.displacement.size(); ++i) {
        largest = std::max(largest, norm(rest.displacement[i]));
        difference = std::max(difference, norm(state.displacement[i] - rest.displacement[i]));
      }
      EXPECT_GT(largest, 3e-4) << kind;
      EXPECT_LT(difference, 1e-4 * largest) << kind << " at " << time << " s";
    }
  }
}

/// Two curves on a free body, whose points are at steps: Verlet's sum of impulses is the
/// trapezoidal rule, and so the integral of each curve. The sum of the two factors is the same at
/// all times.
TEST(LoadCurve, MomentumIsTheIntegralOfTheCurve) {
  Scene scene = one_body();
  const Points down{{0.25, 1}, {0.5, -0.5}, {0.75, 2}}, up{{0.25, 0}, {0.5, 1.5}, {0.75, -1}};
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force = {8, 0, 0}, .curve = down});
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force = {0, 4, 0}, .curve = up});
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto integral = [](const Points& curve, double end) {
    const LoadCurve f{curve};
    double sum = 0;
    for (int k = 0; k < 768; ++k) sum += f.at((k + 0.5) * end / 768) * end / 768;
    return sum;  // exact where points lie between the intervals
  };
  for (const Precision precision : {Precision::single, Precision::double_, Precision::mixed}) {
    const auto backend = make_test_backend(model, precision);
    Solver solver(model, *backend, initial_state(model, scene, 1.0 / 512), Method::verlet);
    for (const double end : {0.25, 0.5, 0.75, 1.0}) {
      while (solver.time() < end) solver.step();
      const Vec3d momentum = diagnose(model, *backend, solver.now()).momentum;
      const Vec3d expected{8 * integral(down, end), 4 * integral(up, end), 0};
      const double tolerance = precision == Precision::double_ ? 1e-12 : 1e-4;
      EXPECT_NEAR(momentum.x, expected.x, 8 * tolerance) << end;
      EXPECT_NEAR(momentum.y, expected.y, 4 * tolerance) << end;
      EXPECT_NEAR(momentum.z, 0, 4 * tolerance) << end;
    }
  }
}

/// A given step resolves the time in which the steepest piece would cross the curve's whole range.
TEST(LoadCurve, BoundsTheStep) {
  Scene scene = loaded_block("traction", {{0, 1}, {1e-3, 0.5}, {1, 0}});
  const Model model = build_model(scene);
  const auto backend = make_test_backend(model, Precision::double_);
  scene.time.step = 1e-4;
  EXPECT_NO_THROW(plan_steps(scene, model, *backend));
  scene.time.step = 1.1e-4;
  const std::string refusal = refusal_of([&] { plan_steps(scene, model, *backend); });
  EXPECT_NE(refusal.find("does not resolve body.traction.curve, whose steepest piece would cross "
                         "its range in 0.002 s, of body \"body\""),
            std::string::npos)
      << refusal;
}

/// Curves of scenes made in code are checked as those of files are.
TEST(LoadCurve, OfScenesMadeInCodeAreChecked) {
  const auto refusal = [](auto&& change) {
    Scene scene = loaded_block("follower", {{0, 0}, {1, 1}});
    change(scene.bodies[0].tractions[0]);
    return refusal_of([&] { validate(scene); });
  };
  EXPECT_EQ(refusal([](TractionRequest&) {}), "accepted");
  const std::pair<std::string, void (*)(TractionRequest&)> wrong[] = {
      {"point 2 is [0, 1]",
       [](TractionRequest& t) {
         t.curve = {{0, 0}, {0, 1}};
       }},
      {"point 1 is [0, nan]",
       [](TractionRequest& t) {
         t.curve = {{0, std::nan("")}};
       }},
      {"point 1 is [nan, 0]",
       [](TractionRequest& t) {
         t.curve = {{std::nan(""), 0}};
       }},
      {"1001 points found",
       [](TractionRequest& t) {
         t.curve.clear();
         for (int k = 0; k <= 1000; ++k) t.curve.push_back({1.0 * k, 0});
       }},
      {"found together with ramp", [](TractionRequest& t) { t.ramp = 1; }},
      {"a factor of -2 found at 3 s; allowed with gas", [](TractionRequest& t) {
         t.gas = 1;
         t.curve = {{0, 1}, {3, -2}};
       }}};
  for (const auto& [words, change] : wrong) {
    const std::string found = refusal(change);
    EXPECT_NE(found.find("key body.traction.curve of body \"body\": "), std::string::npos) << found;
    EXPECT_NE(found.find(words), std::string::npos) << found;
  }
}

}  // namespace
}  // namespace phyxel
