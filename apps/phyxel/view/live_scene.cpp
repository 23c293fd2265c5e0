#include "view/live_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "device_option.hpp"
#include "model/ghosts.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "program_ranks.hpp"

namespace phyxel::app {
namespace {

void change(const BodyRequest& body, Material& material, const Settings& settings) {
  if (settings.stiffness &&
      (material.custom_law || has_parameter(law_of(body, material), "young"))) {
    material.young *= *settings.stiffness;
    material.volume_stiffness *= *settings.stiffness;
  }
  if (settings.damping) material.damping = *settings.damping;
}

/// A number as a float has it. Volatile, since GCC 12 leaves the conversion out where it vectorises
/// the last phyxels of a loop.
double in_float(double number) {
  const volatile float rounded = static_cast<float>(number);
  return rounded;
}

/// Checks that ranks step the same phyxels of both models. Collective. @throws AgreedError
void check_cut(const Model& before, const Model& after) {
  const bool same = !before.share || before.share->global_id == after.share->global_id;
  if (all_ranks().smallest(std::int64_t{same}) == 1) return;
  throw AgreedError(ExitCode::bad_input,
                    "set: the bodies would be divided among the ranks in another way; allowed: the "
                    "same values on one rank");
}

}  // namespace

Scene with_settings(Scene scene, const Settings& settings) {
  if (settings.gravity) scene.gravity = *settings.gravity;
  for (BodyRequest& body : scene.bodies) {
    change(body, body.material, settings);
    for (InclusionRequest& inclusion : body.inclusions) change(body, inclusion.material, settings);
  }
  if (settings.friction) {
    const auto rub = [&](auto& contact) {
      contact.friction = *settings.friction;
      contact.kinetic_friction.reset();
    };
    for (ObstacleRequest& obstacle : scene.obstacles) rub(obstacle);
    if (scene.contact) {
      rub(*scene.contact);
      for (ContactPairRequest& pair : scene.contact->pairs) rub(pair);
    }
  }
  return scene;
}

namespace {

void check_method(const Scene& scene) {
  if (scene.solver.method != Method::equilibrium) return;
  throw InputError(
      "method \"equilibrium\": it finds a state of rest, which does not move; allowed for a live "
      "view: verlet, implicit");
}

/// Builds scenes for all ranks of the program.
SceneBuilder builder_of(const Scene& scene, CutOptions cut, bool unsafe_step) {
  return [device = choose_device(scene.solver.device, "device"), cut = std::move(cut),
          unsafe_step](const Scene& changed) {
    return std::make_shared<BuiltScene>(
        std::make_unique<const SharedModel>(all_ranks(), changed, device, cut), changed,
        unsafe_step);
  };
}

}  // namespace

LiveScene::LiveScene(Scene scene, CutOptions cut, bool unsafe_step)
    : given_(std::move(scene)),
      scene_(given_),
      builder_(builder_of(scene_, std::move(cut), unsafe_step)) {
  check_method(scene_);
  reset();
}

LiveScene::LiveScene(Scene scene, std::shared_ptr<BuiltScene> steps, SceneBuilder builder)
    : given_(std::move(scene)),
      scene_(given_),
      builder_(std::move(builder)),
      built_(std::move(steps)) {
  check_method(scene_);
  const std::span<const Vec3d> forces = built_->backend->external_forces();
  forces_.assign(forces.begin(), forces.end());
  taken_over_ = built_->solver->state();
  now_ = diagnose(model(), backend(), solver());
}

void LiveScene::begin(std::shared_ptr<BuiltScene> built, const State& state) {
  built_ = std::move(built);
  if (!forces_.empty()) backend().set_external_forces(forces_);
  now_ = built_->begin(state, scene_.solver.method);
}

void LiveScene::advance(std::int64_t count) {
  BuiltScene& b = *built_;
  while (count > 0) {
    b.plan.halve(b.control->look(*b.solver, b.plan.halvings));
    if (hand_ && hand_->until_due() == 0) hand_->pull(*b.backend, b.solver->now().lag);
    std::int64_t limit = std::min(b.solver->steps() + count, b.control->next_look(*b.solver));
    if (hand_) limit = std::min(limit, b.solver->steps() + hand_->until_due());
    const int steps = b.solver->steps_to(limit);
    b.solver->step(steps);
    if (hand_) hand_->stepped(steps, b.solver->dt());
    count -= steps;
    taken_ += steps;
  }
}

const Diagnostics& LiveScene::look() {
  BuiltScene& b = *built_;
  b.backend->wait();
  // The hand brings energy in, so that after it the watch begins anew.
  if (hand_ || acted_) b.watch.reset();
  now_ = b.look();
  if (!b.watch && forces_.empty()) b.watch.emplace(model(), now_);
  acted_ = false;
  if (hand_) held_work_ = hand_->work_until(*b.backend, b.solver->now().lag);
  return now_;
}

void LiveScene::finish() {
  let_go();
  acted_ = true;
  look();
}

void LiveScene::let_go() {
  if (!hand_) return;
  worked_ += hand_->let_go(backend(), solver().now().lag);
  pushed_ += hand_->impulse();
  held_work_ = 0;
  hand_.reset();
}

void LiveScene::apply(const Request& act) {
  acted_ = true;
  switch (act.kind) {
    case RequestKind::grab: {
      Hand hand(model(), act.phyxel, solver().dt(), forces_);
      let_go();
      hand_.emplace(std::move(hand));
      break;
    }
    case RequestKind::move:
      if (hand_) hand_->move(act.by);
      break;
    case RequestKind::drop:
      let_go();
      break;
    case RequestKind::set:
      set(act.settings);
      break;
    case RequestKind::reset:
      reset();
      break;
    default:
      break;
  }
}

void LiveScene::reset() {
  std::shared_ptr<BuiltScene> made = builder_(scene_);
  State state;
  if (!taken_over_) {
    state = initial_state(made->model(), scene_, made->plan.dt);
  } else if (settings_ == Settings{}) {
    state = *taken_over_;
  } else {
    const std::shared_ptr<BuiltScene> first = builder_(given_);
    if (!forces_.empty()) first->backend->set_external_forces(forces_);
    first->begin(*taken_over_, scene_.solver.method);
    state = carried_over(*first, *made);
  }
  hand_.reset();
  worked_ = held_work_ = 0;
  pushed_ = {};
  begin(std::move(made), state);
}

void LiveScene::refresh_ghosts(State& state) const {
  if (!model().share) return;
  phyxel::refresh_ghosts(*model().share, state.displacement);
  phyxel::refresh_ghosts(*model().share, state.velocity);
}

void LiveScene::move_velocities(BuiltScene& by, State& state, double share) const {
  if (scene_.solver.method != Method::verlet) return;
  Solver solver(by.model(), *by.backend, state, Method::verlet);
  solver.step(1);
  by.backend->wait();
  const State next = solver.state();
  for (std::size_t i = 0; i < state.velocity.size(); ++i) {
    Vec3d& v = state.velocity[i];
    v = v + share * (next.velocity[i] - v);
    if (scene_.solver.precision == Precision::single)
      v = {in_float(v.x), in_float(v.y), in_float(v.z)};
  }
  refresh_ghosts(state);
}

State LiveScene::carried_over(BuiltScene& from, BuiltScene& next) const {
  from.backend->wait();
  State state = from.solver->state();
  refresh_ghosts(state);
  // Velocities are half a step old. Those of the present time stay: half of the old model's next
  // step leads there, and half of the new one's leads back.
  move_velocities(from, state, 0.5);
  if (next.plan.dt != state.dt) {
    state.looks = {};
    if (state.time > 0) {  // a step that divides the time so far, at most the planned one
      // Within the first steps, that would be much less: there, the time moves by half a step at
      // most.
      constexpr double least_share = 0.95;
      state.step = static_cast<std::int64_t>(std::ceil(state.time / next.plan.dt));
      const double fitting = state.time / static_cast<double>(state.step);
      if (fitting > least_share * next.plan.dt) {
        next.plan.dt = fitting;
      } else {
        state.step = std::llround(state.time / next.plan.dt);
        state.time = static_cast<double>(state.step) * next.plan.dt;
      }
    }
    state.dt = next.plan.dt;
  }
  move_velocities(next, state, -0.5);
  return state;
}

void LiveScene::set(const Settings& settings) {
  Settings all = settings_;
  all.take(settings);
  Scene changed = with_settings(given_, all);
  std::shared_ptr<BuiltScene> made = builder_(changed);  // throws before anything has changed
  check_cut(model(), made->model());
  let_go();
  if (!forces_.empty()) made->backend->set_external_forces(forces_);
  const State state = carried_over(*built_, *made);
  settings_ = all;
  scene_ = std::move(changed);
  begin(std::move(made), state);
}

}  // namespace phyxel::app
