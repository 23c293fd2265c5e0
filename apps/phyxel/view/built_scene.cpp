#include "view/built_scene.hpp"

#include <fmt/format.h>

#include <utility>

#include "phyxel/error.hpp"

namespace phyxel::app {

BuiltScene::BuiltScene(std::unique_ptr<const SharedModel> model, const Scene& scene,
                       bool unsafe_step)
    : shared(std::move(model)),
      backend(shared->make_backend(scene.solver.precision, scene.solver.threads)),
      plan(plan_steps(scene, shared->here(), *backend, unsafe_step)) {}

Diagnostics BuiltScene::begin(const State& state, Method method) {
  solver.emplace(model(), *backend, state, method);
  control.emplace(model(), *backend, plan);
  const Diagnostics now = diagnose(model(), *backend, *solver);
  watch.reset();
  if (backend->external_forces().empty()) watch.emplace(model(), now);
  return now;
}

Diagnostics BuiltScene::look() {
  const Diagnostics now = diagnose(model(), *backend, *solver);
  if (watch) {
    watch->check(now, &*control);
    control->see(*solver);
  } else if (now.bad_phyxel >= 0) {
    throw DivergedError(fmt::format("step {}, t = {:g} s: the state of phyxel {} is not finite",
                                    now.step, now.time, now.bad_phyxel));
  }
  return now;
}

}  // namespace phyxel::app
