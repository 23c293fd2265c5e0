#include "phyxel/solver.hpp"

namespace phyxel {
State initial_state(const Model& model, const Scene& scene, double dt) {
  State state;
  state.dt = dt;
  state.displacement.resize(static_cast<std::size_t>(model.size()));
  state.velocity.resize(state.displacement.size());
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    const Part& part = model.parts[p];
    // The stored velocity is that of half a step earlier: v(-dt/2) = v(0) - dt/2 a(0). At rest
    // there are no internal forces.
#pragma omp parallel for schedule(static)
    for (Index i = part.begin; i < part.end; ++i) {
      state.velocity[i] =
          scene.bodies[p].velocity + cross(scene.bodies[p].spin, model.position[i] - part.centre);
      state.velocity[i] -= (dt / 2) * model.gravity;
    }
  }
  for (const Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      const Index i = load.phyxels[k];
      state.velocity[i] -= (dt / 2 * load.scale_at(0) / model.mass[i]) * load.force[k];
    }
  }
  for (const Motion& motion : model.motions) {
    for (const Index i : motion.phyxels) {
      state.displacement[i] = motion.displacement_at(0);
      state.velocity[i] = {};
    }
  }
  return state;
}

Solver::Solver(Backend& backend, const State& start)
    : backend_(backend), steps_(start.step), dt_(start.dt) {
  backend_.upload(start);
}

void Solver::step() {
  backend_.stress();              // u -> ∇u -> ε -> σ -> Q
  backend_.advance(time(), dt_);  // gather of Q -> f -> loads -> Verlet -> u⁺
  ++steps_;
}

State Solver::state() const {
  State state;
  backend_.download(state);
  state.step = steps_;
  state.dt = dt_;
  state.time = time();
  return state;
}

}  // namespace phyxel
