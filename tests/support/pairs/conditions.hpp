/// What the library refuses beside the pairs of `refusals()`: combinations of values that the table
/// of factors does not have. docs/combinations.md lists them with their reasons.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "phyxel/equilibrium.hpp"
#include "phyxel/ranks.hpp"
#include "phyxel/shared_model.hpp"
#include "phyxel/solver.hpp"
#include "support/pairs/refusals.hpp"
#include "support/pairs/scene.hpp"

namespace phyxel::testing {

/// What is refused, and why.
struct Condition {
  const char* name;                ///< For the name of the test.
  const char* what;                ///< In words.
  std::vector<std::string> words;  ///< Key, value and what is allowed, as the error names them.
  const char* reason;
  /// Changes a scene that is computed, and its body, into what is refused.
  std::function<void(Scene&, Cloud&)> change;
};
inline void PrintTo(const Condition& condition, std::ostream* out) { *out << condition.what; }

/// Models, plans and steps a scene of one body on the CPU, by all ranks together.
inline void compute(const Ranks& ranks, const Scene& scene, const Cloud& cloud) {
  const SharedModel shared(ranks, scene, {cloud}, choose_device("cpu"));
  const auto backend = shared.make_backend(scene.solver.precision, 1);
  const StepPlan plan = plan_steps(scene, shared.here(), *backend);
  Solver solver(shared.here(), *backend, initial_state(shared.here(), scene, plan.dt),
                scene.solver.method);
  solver.step();
}

/// A fixed beam that has an equilibrium.
inline Scene resting_beam() {
  Combination row{Levels(factor_count, 0)};
  row.levels[boundary] = level_of(boundary, "fixed");
  row.levels[precision] = level_of(precision, "double");
  row.levels[method] = level_of(method, "equilibrium");
  return scene_of(row);
}

inline const std::vector<Condition>& conditions() {
  static const std::vector<Condition> all{
      {"EndlessMotion",
       "equilibrium with a motion by `velocity` or `amplitude`",
       {"a motion with a velocity or an amplitude", "allowed", "motions by a displacement"},
       "such a motion never ends, so that nothing comes to rest",
       [](Scene& scene, Cloud&) {
         scene.bodies[0].motions.push_back(
             {.select = in_box({0.73, -1, -1}, {2, 1, 1}), .velocity = {0.1, 0, 0}});
       }},
      {"Unsupported",
       "equilibrium of a body that nothing holds against its weight or loads",
       {"body \"body\": nothing is held against a force of", "needed are fixed phyxels"},
       "the body accelerates for ever",
       [](Scene& scene, Cloud&) { scene.bodies[0].fixed.clear(); }},
      {"ImplicitWithoutStep",
       "implicit steps without `time.step`",
       {"time.step = \"adaptive\"", "needed is one"},
       "implicit steps are stable at any size, so that no size follows from the scene",
       [](Scene& scene, Cloud&) {
         scene.solver.method = Method::implicit;
         scene.time.step.reset();
       }},
      {"UnstableStep",
       "Verlet's steps above the largest stable one",
       {"time.step = 1 s is unstable", "allowed below that"},
       "the motion would grow without bound; `--unsafe-step` tries it",
       [](Scene& scene, Cloud&) {
         scene.solver.method = Method::verlet;
         scene.time.step = 1;
         scene.time.end = 2;
       }},
      {"ClosureWithoutSurface",
       "closed gradients of a body without a closed surface",
       {"closed gradients (closure = 0.001)", "allowed are a mesh", "closure = 0"},
       "the surface is what gradients are closed to",
       [](Scene& scene, Cloud& cloud) {
         scene.bodies[0].closure = 1e-3;
         cloud.surface = {};
       }},
      {"InclusionsEverywhere",
       "inclusions that leave no phyxel of the body's own material",
       {"no phyxel is left of its own material", "allowed are inclusions that leave some"},
       "the part of the body's own material carries its surfels",
       [](Scene& scene, Cloud&) {
         scene.bodies[0].inclusions.push_back({in_box({-9, -9, -9}, {9, 9, 9}), rubber()});
       }},
      {"TwoMotionsOfAnAxis",
       "two entries of `fixed` and `motion` that move the same axis of a phyxel otherwise",
       {"is already fixed or moved by fixed 1", "allowed: one motion for each of its axes"},
       "two motions of one axis contradict each other",
       [](Scene& scene, Cloud&) {
         scene.bodies[0].motions.push_back(
             {.select = in_box({-1, -1, -1}, {0.07, 1, 1}), .displacement = {0.1, 0, 0}});
       }}};
  return all;
}

}  // namespace phyxel::testing
