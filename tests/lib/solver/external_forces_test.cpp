/// Forces of the caller's own, on the CPU and in programs built with PHYXEL_TEST_CUDA on a GPU.
#include <gtest/gtest.h>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

constexpr Precision all_precisions[] = {Precision::single, Precision::double_, Precision::mixed};

/// A block held at one end; with a load on its other end, in the scene.
Scene held_block(bool loaded) {
  Scene scene = one_body();
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {0.1, 1, 1}}}});
  if (loaded) {
    LoadRequest load;
    load.select.box = Selection::Box{{0.5, -1, -1}, {2, 1, 1}};
    load.force = {0, 3, 1};
    scene.bodies[0].loads.push_back(load);
  }
  return scene;
}
const Cloud block = lattice(7, 3, 4, 0.1, 0.1);

/// The forces of that load, for a model without it.
std::vector<Vec3d> load_of(const Model& loaded) {
  std::vector<Vec3d> force(loaded.position.size());
  const Load& load = loaded.loads.at(0);
  for (std::size_t k = 0; k < load.phyxels.size(); ++k) force[load.phyxels[k]] = load.force[k];
  return force;
}

TEST(ExternalForces, ActLikeALoadToTheLastBit) {
  const Scene with_load = held_block(true);
  const Model loaded = model_of(with_load, block), free = model_of(held_block(false), block);
  for (const Precision precision : all_precisions) {
    const double dt = 1e-3;
    const auto expected = make_test_backend(loaded, precision),
               got = make_test_backend(free, precision);
    const State start = initial_state(loaded, with_load, dt);
    Solver one(*expected, start), other(*got, start);
    got->set_external_forces(load_of(loaded));
    for (int k = 0; k < 50; ++k) one.step(), other.step();
    EXPECT_EQ(one.state().displacement, other.state().displacement);
    EXPECT_EQ(one.state().velocity, other.state().velocity);
    const Diagnostics a = diagnose(loaded, *expected, one.now()),
                      b = diagnose(free, *got, other.now());
    EXPECT_EQ(a.kinetic_energy, b.kinetic_energy);  // velocities at t know of all forces
    EXPECT_EQ(a.internal_force, b.internal_force);
    EXPECT_NE(a.load_energy, 0);
    EXPECT_EQ(b.load_energy, 0);
  }
}

TEST(ExternalForces, CountInEquilibriaAndImplicitSteps) {
  Scene with_load = held_block(true);
  const Model loaded = model_of(with_load, block), free = model_of(held_block(false), block);
  const auto expected = make_test_backend(loaded, Precision::double_),
             got = make_test_backend(free, Precision::double_);
  got->set_external_forces(load_of(loaded));
  EXPECT_EQ(find_equilibrium(loaded, *expected).state.displacement,
            find_equilibrium(free, *got).state.displacement);
  with_load.solver.method = Method::implicit;
  const State start = initial_state(loaded, with_load, 0.01);
  Solver one(loaded, *expected, start, Method::implicit),
      other(free, *got, start, Method::implicit);
  one.step(), other.step();
  EXPECT_EQ(one.state().displacement, other.state().displacement);
}

TEST(ExternalForces, EndWhenNoneAreSet) {
  const Model model = model_of(one_body(), block);
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(*backend, state_of(std::vector<Vec3d>(model.position.size())));
  std::vector<Vec3d> force;
  for (const double mass : model.mass) force.push_back({mass, 0, 0});  // 1 m/s²
  backend->set_external_forces(force);
  solver.step();
  backend->set_external_forces({});
  solver.step();
  for (const Vec3d& v : solver.state().velocity) EXPECT_NEAR(v.x, solver.dt(), 1e-12 * solver.dt());
  EXPECT_TRUE(backend->external_forces().empty());
}

TEST(ExternalForces, OfAnotherNumberAreRefused) {
  const Model model = model_of(one_body(), block);
  const auto backend = make_test_backend(model, Precision::double_);
  try {
    backend->set_external_forces(std::vector<Vec3d>(3));
    FAIL() << "three forces were taken";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "3 external forces for 84 phyxels: allowed are 84 or none");
  }
}

/// Forces that change amid a run act from the next step on, beside the scene's load, and those that
/// end leave the load as it was: per step, the impulse is the sum of both.
TEST(ExternalForces, MayChangeAmidARunBesideALoad) {
  Scene scene = one_body();
  LoadRequest load;
  load.select.all = true;
  load.force = {0, 0, 2};
  scene.bodies[0].loads.push_back(load);
  const Model model = model_of(scene, block);
  const double mass = model.parts[0].mass, dt = 1e-3;
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(*backend, initial_state(model, scene, dt));
  std::vector<Vec3d> force(model.position.size());
  double expected = 0;
  for (int k = 0; k < 60; ++k) {
    if (k % 20 == 0) {
      const double acceleration = 3 - k / 20;
      for (Index i = 0; i < model.size(); ++i) force[i] = {acceleration * model.mass[i], 0, 0};
      k < 40 ? backend->set_external_forces(force) : backend->set_external_forces({});
    }
    if (k < 40) expected += (3 - k / 20) * mass * dt;
    solver.step();
  }
  Vec3d momentum;
  const State end = solver.state();
  for (Index i = 0; i < model.size(); ++i) momentum += model.mass[i] * end.velocity[i];
  // Sixty sums in double of internal forces that cancel. Velocities are half a step behind, and
  // those of the start know of the load, but not of the caller's forces.
  EXPECT_NEAR(momentum.x, expected, 1e-12 * expected);
  EXPECT_NEAR(momentum.z, 59.5 * 2 * dt, 1e-12);
}

}  // namespace
}  // namespace phyxel
