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

/// The model with its backend and solver, which a change of settings makes anew.
struct LiveScene::Built {
  Built(const Scene& scene, const ChosenDevice& device, const CutOptions& cut, bool unsafe_step)
      : shared(all_ranks(), scene, device, cut),
        backend(shared.make_backend(scene.solver.precision, scene.solver.threads)),
        plan(plan_steps(scene, shared.here(), *backend, unsafe_step)) {}

  SharedModel shared;
  std::unique_ptr<Backend> backend;
  StepPlan plan;
  std::optional<Solver> solver;
  std::optional<StepControl> control;
  std::optional<StabilityWatch> watch;
};

LiveScene::LiveScene(Scene scene, CutOptions cut, bool unsafe_step)
    : given_(std::move(scene)),
      scene_(given_),
      device_(choose_device(scene_.solver.device, "device")),
      cut_(std::move(cut)),
      unsafe_step_(unsafe_step) {
  if (scene_.solver.method == Method::equilibrium) {
    throw InputError(
        "method \"equilibrium\": it finds a state of rest, which does not move; allowed for a live "
        "view: verlet, implicit");
  }
  auto made = built(scene_);
  const State state = initial_state(made->shared.here(), scene_, made->plan.dt);
  begin(std::move(made), state);
}

LiveScene::~LiveScene() = default;

const SharedModel& LiveScene::shared() const { return built_->shared; }
Backend& LiveScene::backend() const { return *built_->backend; }
const Solver& LiveScene::solver() const { return *built_->solver; }

std::unique_ptr<LiveScene::Built> LiveScene::built(const Scene& scene) const {
  return std::make_unique<Built>(scene, device_, cut_, unsafe_step_);
}

void LiveScene::begin(std::unique_ptr<Built> built, const State& state) {
  built_ = std::move(built);
  Built& b = *built_;
  b.solver.emplace(model(), *b.backend, state, scene_.solver.method);
  b.control.emplace(model(), *b.backend, b.plan);
  now_ = diagnose(model(), *b.backend, *b.solver);
  b.watch.emplace(model(), now_);
}

void LiveScene::advance(std::int64_t count) {
  Built& b = *built_;
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
  Built& b = *built_;
  b.backend->wait();
  now_ = diagnose(model(), *b.backend, *b.solver);
  // The hand brings energy in, so that after it the watch begins anew.
  if (hand_ || acted_) {
    b.watch.emplace(model(), now_);
  } else {
    b.watch->check(now_, &*b.control);
  }
  acted_ = false;
  if (hand_) held_work_ = hand_->work_until(*b.backend, b.solver->now().lag);
  return now_;
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
      Hand hand(model(), act.phyxel, solver().dt());
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
    case RequestKind::reset: {
      auto made = built(scene_);
      hand_.reset();
      worked_ = held_work_ = 0;
      pushed_ = {};
      const State state = initial_state(made->shared.here(), scene_, made->plan.dt);
      begin(std::move(made), state);
      break;
    }
    default:
      break;
  }
}

void LiveScene::refresh_ghosts(State& state) const {
  if (!model().share) return;
  phyxel::refresh_ghosts(*model().share, state.displacement);
  phyxel::refresh_ghosts(*model().share, state.velocity);
}

void LiveScene::move_velocities(Built& by, State& state, double share) const {
  if (scene_.solver.method != Method::verlet) return;
  Solver solver(by.shared.here(), *by.backend, state, Method::verlet);
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

State LiveScene::carried_over(Built& next) const {
  Built& from = *built_;
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
  auto made = built(changed);  // throws before anything has changed
  check_cut(model(), made->shared.here());
  let_go();
  const State state = carried_over(*made);
  settings_ = all;
  scene_ = std::move(changed);
  begin(std::move(made), state);
}

}  // namespace phyxel::app
