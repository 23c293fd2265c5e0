#include "phyxel/solver.hpp"

#include <algorithm>
#include <cmath>

#include "phyxel/equilibrium.hpp"
#include "phyxel/physics/verlet.hpp"
#include "solver/implicit_step.hpp"
#include "solver/owned_vectors.hpp"

namespace phyxel {

State initial_state(const Model& model, const Scene& scene, double dt) {
  // Verlet's velocity is that of half a step earlier, from which half a step under a(0) and damping
  // leads to v(0). At rest there are no internal forces.
  const double lag = scene.solver.method == Method::verlet ? dt / 2 : 0;
  State state;
  state.dt = dt;
  state.displacement.resize(static_cast<std::size_t>(model.size()));
  state.velocity.resize(state.displacement.size());
  if (scene.solver.method == Method::equilibrium) return state;  // what moves has yet to go there
  std::vector<Vec3d> loaded(model.loads.empty() ? 0 : state.displacement.size());  // [N]
  for (const Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      loaded[load.phyxels[k]] += load.scale_at(0) * load.force[k];
    }
  }
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
    const Path start = motion.path_at(0);
    for (const Index i : motion.phyxels) {
      state.displacement[i] = motion.along_axes(start.at(model.position[i]), state.displacement[i]);
      state.velocity[i] = motion.along_axes({}, state.velocity[i]);
    }
  }
  return state;
}

Solver::Solver(Backend& backend, const State& start)
    : backend_(backend),
      steps_(start.step),
      first_step_(start.step),
      dt_(start.dt),
      looks_(start.looks) {
  backend_.upload(start);
}

Solver::Solver(const Model& model, Backend& backend, const State& start, Method method)
    : Solver(backend, start) {
  model_ = &model;
  method_ = method;
  if (method == Method::equilibrium && start.step == 0) {
    const OwnedVectors vectors(model, std::max(1, backend.threads()));
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

void Solver::step() {
  switch (method_) {
    case Method::verlet:
      backend_.stress();              // u -> ∇u -> ε -> σ -> Q
      backend_.advance(time(), dt_);  // gather of Q -> f -> loads -> Verlet -> u⁺
      break;
    case Method::implicit:
      try {
        implicit_->take(implicit_state_);
      } catch (...) {
        backend_.upload(implicit_state_);  // of the last whole step
        throw;
      }
      backend_.upload(implicit_state_);
      break;
    case Method::equilibrium: {
      const State start = begun_ ? state() : State{};
      const Equilibrium found = find_equilibrium(
          *model_, backend_,
          {.observer = observer_, .start = begun_ ? &start.displacement : nullptr});
      rest_ = {found.evaluations, found.steps, found.residual};
      break;
    }
  }
  ++steps_;
}

Instant Solver::now() const { return {steps_, time(), method_ == Method::verlet ? dt_ / 2 : 0}; }

State Solver::state() const {
  State state;
  backend_.download(state);
  state.step = steps_;
  state.dt = dt_;
  state.time = time();
  state.looks = looks_;
  return state;
}

SolverWork Solver::work() const {
  if (method_ == Method::verlet) return {.evaluations = steps_ - first_step_};
  if (!implicit_) return rest_;
  const NewtonReport& work = implicit_->work();
  return {work.evaluations, work.steps, work.residual};
}

}  // namespace phyxel
