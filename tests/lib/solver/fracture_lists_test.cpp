/// Bodies that break beside bodies whose two passes have lists of their own.
#include <gtest/gtest.h>

#include "support/torn_bar.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// Beside a body with one-sided lists the second pass of a step has lists of its own, in which
/// pairs break, too: energy grew by orders of magnitude where they did not.
TEST(FractureLists, KeepMomentumBesideABodyWithOneSidedLists) {
  Scene scene = TornBar().scene;
  scene.bodies.push_back(scene.bodies[0]);
  BodyRequest& other = scene.bodies[1];
  other.name = "other";
  other.spin = {};
  other.fracture.reset();
  other.material.hourglass = 0;
  other.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  const std::vector<Cloud> clouds{lattice(24, 5, 5, 0.05), lattice(5, 4, 3, 0.1)};
  const Model model = build_model(scene, clouds);
  ASSERT_FALSE(model.neighbourhood.symmetric);
  const auto backend = make_test_backend(model, Precision::double_);
  State state = initial_state(model, scene, 0.3 * step_limit(model).largest_step);
  for (Index i = 0; i < model.parts[0].end; ++i) {
    state.velocity[i].x += 12 * (model.position[i].x - model.parts[0].centre.x);
  }
  Solver solver(model, *backend, state, Method::verlet);
  const Diagnostics start = diagnose(model, *backend, solver);
  solver.step(700);
  const Diagnostics end = diagnose(model, *backend, solver);
  EXPECT_GT(solver.state().broken.size(), 100u);
  EXPECT_LT(norm(end.momentum - start.momentum), 1e-12 * norm(start.momentum));
  EXPECT_NEAR(end.total_energy(), start.total_energy(), 2e-3 * start.total_energy());
  // A state that is put in has the same pairs in both lists.
  std::vector<Vec3d> present, put_in;
  backend->internal_forces(present);
  const auto fresh = make_test_backend(model, Precision::double_);
  fresh->upload(solver.state());
  fresh->internal_forces(put_in);
  EXPECT_EQ(present, put_in);
}

}  // namespace
}  // namespace phyxel
