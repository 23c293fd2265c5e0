/// A bar that flies apart.
#pragma once

#include <memory>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel::testing {

/// A bar that is torn by its own motion: it breaks into free pieces.
struct TornBar {
  explicit TornBar(Precision precision = Precision::double_, int threads = 0) {
    scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000, .hourglass = 0.1});
    scene.bodies[0].spin = {0, 0, 20};
    scene.bodies[0].velocity = {1, 2, 3};
    scene.bodies[0].fracture = FractureRequest{.energy_release_rate = 5, .scatter = 8, .seed = 5};
    scene.bodies[0].fracture->where = "test";
    model = model_of(scene, lattice(24, 5, 5, 0.05));
    dt = 0.5 * step_limit(model).largest_step;
    backend = make_test_backend(model, precision, threads);
    State state = initial_state(model, scene, dt);
    for (Index i = 0; i < model.size(); ++i) {
      state.velocity[i].x += 12 * (model.position[i].x - model.parts[0].centre.x);
    }
    solver = std::make_unique<Solver>(model, *backend, state, Method::verlet);
  }
  Diagnostics now() { return diagnose(model, *backend, *solver); }

  Scene scene;
  Model model;
  std::unique_ptr<Backend> backend;
  std::unique_ptr<Solver> solver;
  double dt = 0;
};

}  // namespace phyxel::testing
