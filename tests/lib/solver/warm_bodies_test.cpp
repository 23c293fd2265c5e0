/// Bodies that expand with their temperature: free ones without stress, held ones with that of the
/// theory, their energies, and restarts while the temperature changes. On the CPU, and in programs
/// built with PHYXEL_TEST_CUDA on a GPU.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/history.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"
#include "support/refusal.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using Curve = std::vector<std::array<double, 2>>;

constexpr Precision all_precisions[] = {Precision::single, Precision::mixed, Precision::double_};
constexpr double expansion = 1e-4;

Material warm(Material material, const Curve& curve) {
  material.expansion = expansion;
  material.temperature_curve = curve;
  material.hourglass = 0.1;
  return material;
}
void hold(Scene& scene, const Selection::Box& box, Axes axes) {
  Selection select;
  select.box = box;
  scene.bodies[0].fixed.push_back({select, axes});
}
/// A block of 6 × 4 × 4 phyxels whose three low faces are held along their normals: it is free to
/// expand.
Scene on_rollers(const Material& material) {
  Scene scene = one_body(material);
  hold(scene, {{-1, -1, -1}, {0.06, 9, 9}}, {true, false, false});
  hold(scene, {{-1, -1, -1}, {9, 0.06, 9}}, {false, true, false});
  hold(scene, {{-1, -1, -1}, {9, 9, 0.06}}, {false, false, true});
  return scene;
}

/// Searches for rest: each phyxel is where the uniform expansion puts it, without stress, for laws
/// with and without history; the last temperature counts.
TEST(WarmBodies, ExpandFreelyWithoutStress) {
  for (const char* law : {"neo-hookean", "st-venant-kirchhoff", "hencky", "j2", "maxwell"}) {
    Material material = rubber_of(law);
    if (law == std::string("j2")) material.parameters["yield_stress"] = 1e4;  // it passes stress
    const Scene scene = on_rollers(warm(material, {{0, -50}, {1, 700}}));
    const Model model = model_of(scene, lattice(6, 4, 4, 0.1));
    const auto backend = make_test_backend(model, Precision::double_);
    const Equilibrium found = find_equilibrium(model, *backend, {});
    const double strain = 700 * expansion;
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d exact = strain * (model.position[i] - Vec3d{0.05, 0.05, 0.05});
      // The search leaves 1e-6 of the first stress, which would move a phyxel by 1e-7 of a length.
      EXPECT_LE(norm(found.state.displacement[i] - exact), 1e-7 * strain) << law << " " << i;
    }
    backend->put(found.state);
    const Diagnostics now = diagnose(model, *backend, 0, 1);
    // Energies of a strain that is wrong by 1e-7.
    EXPECT_LE(now.elastic_energy(), 1e-13 * 1e5 * strain * strain) << law;
  }
}

/// A bar between two walls bears E α ΔT: the force on a wall, to the second order of α ΔT = 1e-5.
TEST(WarmBodies, HeldBarsPressTheirWalls) {
  Scene scene = one_body(warm(rubber_of("hencky"), {{0, 0.1}}));
  hold(scene, {{-1, -1, -1}, {0.06, 9, 9}}, {true, false, false});
  hold(scene, {{0.84, -1, -1}, {9, 9, 9}}, {true, false, false});
  hold(scene, {{-1, -1, -1}, {9, 0.06, 9}}, {false, true, false});
  hold(scene, {{-1, -1, -1}, {9, 9, 0.06}}, {false, false, true});
  const Model model = model_of(scene, lattice(9, 4, 4, 0.1));
  const auto backend = make_test_backend(model, Precision::double_);
  const Equilibrium found = find_equilibrium(model, *backend, {});
  backend->put(found.state);
  std::vector<Vec3d> force;
  backend->internal_forces(force);
  double wall = 0;
  for (Index i = 0; i < model.size(); ++i) {
    if (model.position[i].x > 0.84) wall += force[i].x;
  }
  const double stress = 1e5 * expansion * 0.1, area = 0.4 * 0.4;
  // Strains across the bar are exact on a lattice, too; held layers have the stress of all.
  EXPECT_NEAR(wall / (stress * area), 1, 1e-4);
  // Energy ½ E (α ΔT)² of the volume.
  EXPECT_NEAR(diagnose(model, *backend, 0, 1).strain_energy,
              0.5 * stress * expansion * 0.1 * 9 * 4 * 4 * 1e-3, 1e-4 * stress * expansion * 0.1);
}

/// A bar between walls is heated and cooled within some of its periods: what temperatures have done
/// is all its energy, in steps of Verlet and implicit ones, with plastic flow and viscosity, too.
TEST(WarmBodies, TheEnergyLedgerIsClosed) {
  const Curve curve{{0, 0}, {0.02, 300}, {0.05, -200}, {0.2, 100}};
  Material metal = rubber_of("j2");
  metal.parameters = {{"yield_stress", 1e3}, {"hardening", 5e3}};
  Material viscous = rubber();
  viscous.viscosity = 1e-3;
  for (const Material& material : {rubber_of("neo-hookean"), metal, viscous}) {
    Scene scene = one_body(warm(material, curve));
    hold(scene, {{-1, -1, -1}, {0.06, 9, 9}}, {true, true, true});
    hold(scene, {{0.84, -1, -1}, {9, 9, 9}}, {true, true, true});
    const Model model = model_of(scene, lattice(9, 4, 4, 0.1));
    const double limit = step_limit(model).largest_step;
    const auto worst_in_steps_of = [&](double dt) {
      const auto backend = make_test_backend(model, Precision::double_);
      Solver solver(*backend, initial_state(model, scene, dt));
      double worst = 0, most = 0;
      while (solver.time() < 0.2) {
        solver.step(20);
        const Diagnostics now = diagnose(model, *backend, solver.now());
        worst = std::max(worst, std::abs(now.total_energy()));
        most = std::max(most, std::abs(now.thermal_work));
      }
      EXPECT_GT(most, 1e-3);  // J: a strain of 0.03 in 0.14 m³ is 0.06 J
      return worst / most;
    };
    const double coarse = worst_in_steps_of(0.2 * limit), fine = worst_in_steps_of(0.1 * limit);
    EXPECT_LE(fine, 2e-2) << material.law;
    EXPECT_LE(fine, 0.6 * coarse) << material.law;
  }
}

/// A run that goes on from a checkpoint between two points of the curve has the bits of one that
/// was not stopped; the histories hold the time.
TEST(WarmBodies, RestartsGoOnToTheBit) {
  Scene scene = one_body(warm(rubber_of("neo-hookean"), {{0, 0}, {0.01, 300}, {0.03, 0}}));
  hold(scene, {{-1, -1, -1}, {0.06, 9, 9}}, {true, true, true});
  const Model model = model_of(scene, lattice(6, 4, 4, 0.1, 0.2));
  const double dt = 0.5 * step_limit(model).largest_step;
  for (const Precision precision : all_precisions) {
    const auto whole = make_test_backend(model, precision),
               parts = make_test_backend(model, precision);
    Solver solver(*whole, initial_state(model, scene, dt));
    solver.step(40);
    const State middle = solver.state();
    solver.step(40);
    Solver second(*parts, middle);
    second.step(40);
    EXPECT_TRUE(solver.state().displacement == second.state().displacement);
    EXPECT_TRUE(solver.state().history == second.state().history);
    EXPECT_TRUE(std::any_of(middle.displacement.begin(), middle.displacement.end(),
                            [](Vec3d u) { return norm(u) > 1e-4; }));
  }
}

/// What does not expand has no history of it.
TEST(WarmBodies, BodiesWithoutExpansionPayNothing) {
  Material material = rubber();
  material.temperature_change = 100;
  EXPECT_TRUE(history_columns(model_of(one_body(material), lattice(3, 3, 3, 0.1))).empty());
  material.expansion = 1e-5;
  EXPECT_EQ(history_columns(model_of(one_body(material), lattice(3, 3, 3, 0.1))).size(), 12u);
}

}  // namespace
}  // namespace phyxel
