#include "phyxel/solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "joined_over_ranks.hpp"
#include "model/fracture.hpp"
#include "model/owned_vectors.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/verlet.hpp"
#include "rank_sums.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/broken_pairs.hpp"
#include "solver/host_threads.hpp"
#include "solver/implicit_step.hpp"
#include "solver/newton.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

State initial_state(const Model& model, const Scene& scene, double dt) {
  if (!model.parts.empty() && model.parts.back().body >= static_cast<Index>(scene.bodies.size())) {
    throw InputError(
        fmt::format("a model of {} bodies and a scene of {}: allowed is the scene that "
                    "the model was built from",
                    model.parts.back().body + 1, scene.bodies.size()));
  }
  // Verlet's method starts with the velocity half a step earlier, from which half a step under a(0)
  // and damping leads to v(0). There are no internal forces at rest.
  const double lag = scene.solver.method == Method::verlet ? dt / 2 : 0;
  State state;
  state.dt = dt;
  state.displacement.resize(static_cast<std::size_t>(model.size()));
  state.velocity.resize(state.displacement.size());
  check_unbreakable(model, scene);
  state.broken = notched_pairs(model, scene);
  // Prescribed phyxels have not moved yet.
  if (scene.solver.method == Method::equilibrium) return state;
  std::vector<Vec3d> loaded(model.loads.empty() ? 0 : state.displacement.size());  // [N]
  add_loads_at_rest(model, 0, loaded);
  for (const Part& part : model.parts) {
    const BodyRequest& body = scene.bodies[static_cast<std::size_t>(part.body)];
#pragma omp parallel for schedule(static)
    for (Index i = part.begin; i < part.end; ++i) {
      const Vec3d start = body.velocity + cross(body.spin, model.position[i] - part.centre);
      const Vec3d acceleration =
          loaded.empty() ? model.gravity : model.gravity + (1 / model.mass[i]) * loaded[i];
      state.velocity[i] = velocity_before(start, acceleration, part.material.damping, lag);
    }
  }
  for (const Motion& motion : model.motions) {
    for (const Index i : motion.phyxels) {
      state.velocity[i] = motion.along_axes({}, state.velocity[i]);
    }
  }
  prescribe_displacements(model, 0, state.displacement);
  return state;
}

namespace {

/// @throws InputError if the steps or the step size of a state are none
void check_times(const State& state) {
  if (!(state.dt > 0) || !std::isfinite(state.dt)) {
    throw InputError(fmt::format("dt = {} s of a state; allowed: dt > 0, finite", state.dt));
  }
  if (state.step < 0) {
    throw InputError(fmt::format("step = {} of a state; allowed: >= 0", state.step));
  }
}

/// Refuses restitution and free bodies to methods by penalties.
void refuse_impacts(const Model& model, Method method) {
  const auto refuse = [&](const std::string& why) {
    if (model.share) throw AgreedError(ExitCode::bad_input, why);
    throw InputError(why);
  };
  const auto check = [&](const ContactLaw& law, const std::string& section,
                         const std::string& of_what) {
    if (!(law.restitution > 0)) return;
    refuse(fmt::format(
        "{}.restitution = {:g}{} found with solver.method = \"{}\"; allowed with this method: 0, "
        "since its contact is elastic and has no impacts in which a surface could lose speed",
        section, law.restitution, of_what, method_name(method)));
  };
  for (const Obstacle& obstacle : model.obstacles) {
    if (obstacle.free) {
      refuse(fmt::format(
          "obstacle.density of obstacle \"{}\", a free rigid body, found with solver.method = "
          "\"{}\"; allowed with this method: obstacles at rest or on a path",
          obstacle.name, method_name(method)));
    }
    check(obstacle.law, "obstacle", fmt::format(" of obstacle \"{}\"", obstacle.name));
  }
  if (!model.body_contact.acts()) return;
  check(model.body_contact.law, "contact", "");
  for (const BodyContact::Pair& pair : model.body_contact.pairs) {
    check(pair.law, "contact.pair", "");
  }
}

/// Refuses pairs that break to the search for equilibrium, in which none would.
void refuse_fracture(const Model& model) {
  if (!model.fracture.breaks) return;
  const char* why =
      "body.fracture found with solver.method = \"equilibrium\"; allowed with this method: bodies "
      "that do not break, which may have notches, or \"verlet\" and \"implicit\"";
  if (model.share) throw AgreedError(ExitCode::bad_input, why);
  throw InputError(why);
}

}  // namespace

Solver::Solver(Backend& backend, const State& start)
    : backend_(backend),
      steps_(start.step),
      first_step_(start.step),
      dt_(start.dt),
      looks_(start.looks),
      work_before_(start.step_sums),
      work_of_backend_(backend.step_sums()) {
  check_times(start);
  backend_.upload(start);
}

Solver::Solver(const Model& model, Backend& backend, const State& start, Method method)
    : Solver(backend, start) {
  check_fits(model, backend);
  if (method != Method::verlet) check_precision(backend, method);
  if (method != Method::verlet) refuse_impacts(model, method);
  if (method == Method::equilibrium) refuse_fracture(model);
  const std::size_t words = words_of(no_step_sums(model)).size();
  if (!start.step_sums.empty() && start.step_sums.size() != words) {
    throw InputError(
        fmt::format("step_sums of a state has {} words; allowed for the supports and obstacles of "
                    "this model: {} or none",
                    start.step_sums.size(), words));
  }
  model_ = &model;
  method_ = method;
  if (method == Method::equilibrium && start.step == 0) {
    const OwnedVectors vectors(model, host_threads(backend));
    begun_ = vectors.largest([&](Index i) { return norm(start.displacement[i]); }) > 0;
  }
  if (method != Method::implicit) return;
  implicit_ = std::make_unique<ImplicitStep>(model, backend);
  implicit_state_ = start;
}

Solver::~Solver() = default;

void Solver::observe(NewtonObserver observer) {
  if (implicit_) implicit_->observe(observer);
  observer_ = std::move(observer);
}

void Solver::step(std::int64_t count, bool move_surfels) {
  if (method_ == Method::verlet) {
    const std::int64_t most =
        backend_.best_steps();  // a law that throws, throws in the first step of a call
    while (count > 0) {
      const std::int64_t some = std::min(count, most);
      backend_.step(steps_, dt_, static_cast<int>(some), move_surfels);
      steps_ += some;
      count -= some;
    }
    return;
  }
  for (; count > 0; --count) {
    step_by_newton();
    ++steps_;
    if (move_surfels) backend_.update_surfels();
  }
}

int Solver::steps_to(std::int64_t limit) const {
  const std::int64_t most = method_ == Method::verlet ? backend_.best_steps() : 1;
  return static_cast<int>(std::clamp<std::int64_t>(limit - steps_, 1, most));
}

void Solver::step_by_newton() {
  switch (method_) {
    case Method::verlet:
      break;
    case Method::implicit:
      try {
        implicit_->take(implicit_state_);
      } catch (...) {
        backend_.put(implicit_state_);  // the state of the last whole step
        throw;
      }
      backend_.put(implicit_state_);
      break;
    case Method::equilibrium: {
      const State start = begun_ ? state() : State{};
      const Equilibrium found = find_equilibrium(
          *model_, backend_,
          {.observer = observer_, .start = begun_ ? &start.displacement : nullptr});
      rest_ = {found.evaluations, found.steps, found.residual};
      rest_contact_.clear();
      add_words(rest_contact_, found.contact);
      rest_contact_force_ = found.contact_force;
      break;
    }
  }
}

Instant Solver::now() const { return {steps_, time(), method_ == Method::verlet ? dt_ / 2 : 0}; }

State Solver::state() const {
  State state;
  backend_.download(state);
  state.step = steps_;
  state.dt = dt_;
  state.time = time();
  state.looks = looks_;
  state.step_sums = step_sums();
  if (model_ && model_->share && model_->fracture.acts()) {
    state.broken = joined_pairs(*model_, std::move(state.broken));
    state.worn = joined_over_ranks(*model_->share->communicator, state.worn);
  }
  return state;
}

std::span<const Vec3d> Solver::end_force() const {
  if (!implicit_) return {};
  return implicit_->end_force();
}

std::span<const ExactSum> Solver::end_contact() const {
  if (!implicit_) return rest_contact_;
  return implicit_->end_contact();
}

std::vector<std::int64_t> Solver::step_sums() const {
  StepSums work;
  add_words(work, backend_.step_sums());
  add_words(work, work_of_backend_, -1);
  add_words(work, work_of_changes_);
  if (implicit_) add_words(work, words_of(implicit_->step_sums()));
  if (model_ && !work.empty()) add_over_ranks(*model_, work);
  add_words(work, work_before_);
  return words_of(std::move(work));
}

SolverWork Solver::work() const {
  if (method_ == Method::verlet) return {.evaluations = steps_ - first_step_};
  if (!implicit_) return rest_;
  const NewtonReport& work = implicit_->work();
  return {work.evaluations, work.steps, work.residual};
}

}  // namespace phyxel
