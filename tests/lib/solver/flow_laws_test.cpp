/// Bodies of the laws that flow, beside J2: their energy balance, restarts, threads, implicit steps
/// and rest. Material points are tested in tests/lib/physics.
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

namespace phyxel {
namespace {

using namespace phyxel::testing;

constexpr Precision all_precisions[] = {Precision::single, Precision::mixed, Precision::double_};

/// Metal as soft as rubber, that yields at a strain of 1%, by a table.
Material by_curve() {
  Material m = rubber();
  m.law = "j2-curve";
  m.parameters = {
      {"flow_curve", ParameterValue::Curve{{0, 1e3}, {0.02, 1.5e3}, {0.05, 1.5e3}, {0.4, 3e3}}}};
  return m;
}
/// Likewise with a rate factor, which doubles the flow stress at 1000/s, and softened by half where
/// plastic work has heated it by 100 K.
Material by_rate() {
  Material m = rubber();
  m.law = "johnson-cook";
  m.parameters = {{"yield_stress", 1e3},        {"hardening_modulus", 3e3},
                  {"hardening_exponent", 0.5},  {"rate_factor", 0.1},
                  {"reference_rate", 0.05},     {"specific_heat", 0.02},
                  {"temperature", 300},         {"reference_temperature", 300},
                  {"melting_temperature", 500}, {"softening_exponent", 1}};
  return m;
}
Material clay() {
  Material m = rubber();
  m.law = "clay";
  m.parameters = {{"yield_strain", 0.01}, {"creep_time", 2e-3}, {"plastic_limit", 0.5}};
  return m;
}

/// Rubber that loses seven tenths of its shear modulus, some of it within the time of an impact.
Material relaxing() {
  Material m = rubber();
  m.law = "maxwell";
  m.parameters = {{"relaxation", ParameterValue::Curve{{2e-3, 0.4}, {0.05, 0.3}}}};
  return m;
}
/// What a body has turned into heat [J].
double heat_of(const Diagnostics& now) { return now.plastic_work + now.viscous_work; }

/// A bar along x that moves into what holds its low end, and is squeezed beyond yield.
struct Impact {
  explicit Impact(const Material& material, double speed = -0.8) {
    scene = one_body(material);
    scene.bodies[0].velocity = {speed, 0, 0};
    scene.bodies[0].material.hourglass = 0.1;
    Selection low;
    low.box = Selection::Box{{-1, -1, -1}, {0.05, 1, 1}};
    scene.bodies[0].fixed.push_back({low, {true, false, false}});
    model = model_of(scene, lattice(12, 4, 4, 0.1));
    dt = 0.5 * step_limit(model).largest_step;
  }
  State start(double step) const { return initial_state(model, scene, step); }
  Scene scene;
  Model model;
  double dt = 0;
};

class FlowLaws : public ::testing::TestWithParam<std::pair<const char*, Material>> {
 protected:
  Material material() const { return GetParam().second; }
};

/// Elastic, kinetic, plastic and viscous energy of a body that is crushed.
TEST_P(FlowLaws, TheEnergyLedgerIsClosed) {
  for (const double viscosity : {0.0, 2e-4}) {
    Material m = material();
    m.viscosity = viscosity;
    const Impact impact(m, -0.4);
    const auto worst_in_steps_of = [&](double dt) {
      const auto backend = make_test_backend(impact.model, Precision::double_);
      Solver solver(*backend, impact.start(dt));
      const double start = diagnose(impact.model, *backend, solver.now()).total_energy();
      double worst = 0;
      Diagnostics now;
      while (solver.time() < 0.25) {
        solver.step(40);
        now = diagnose(impact.model, *backend, solver.now());
        worst = std::max(worst, std::abs(now.total_energy() / start - 1));
      }
      EXPECT_GT(heat_of(now), 0.1 * start);
      return worst;
    };
    const double coarse = worst_in_steps_of(0.25 * impact.dt),
                 fine = worst_in_steps_of(0.125 * impact.dt);
    // The work of rates and creep is known to first order in the step, which halves it.
    EXPECT_LE(fine, 1e-3) << viscosity;
    EXPECT_GE(coarse / fine, 1.8) << viscosity;
  }
}

TEST_P(FlowLaws, EvaluationsNeverCommit) {
  const Impact impact(material());
  for (const Precision precision : all_precisions) {
    const auto backend = make_test_backend(impact.model, precision);
    Solver solver(*backend, impact.start(impact.dt));
    solver.step(60);
    const State before = solver.state();
    const Diagnostics energies = diagnose(impact.model, *backend, solver.now());
    EXPECT_GT(heat_of(energies), 0);
    std::vector<Vec3d> force, again;
    std::vector<double> von_mises, volume_ratio;
    backend->internal_forces(force);
    backend->internal_forces(again, HistoryUse::frozen);
    backend->internal_forces(again);
    EXPECT_TRUE(force == again);
    stress_fields(impact.model, *backend, &von_mises, &volume_ratio);
    present_step_limit(impact.model, *backend);
    EXPECT_EQ(heat_of(diagnose(impact.model, *backend, solver.now())), heat_of(energies));
    EXPECT_TRUE(solver.state().history == before.history);
  }
}

/// The forces of a step are those of its displacements and the history that it ends with: frames,
/// probes and energies of implicit steps are taken after that.
TEST_P(FlowLaws, ForcesAreTheSameOnceAStepIsCommitted) {
  const Model model = model_of(one_body(material()), lattice(5, 4, 4, 0.1, 0.2));
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(std::vector<Vec3d>(model.position.size())));
  double scale = 0, apart = 0;
  for (int step = 1; step <= 3; ++step) {
    std::vector<Vec3d> u, force, after;
    for (const Vec3d& x : model.position) u.push_back({0.05 * step * x.y, 0, 0.02 * step * x.x});
    backend->put_displacements(u);
    backend->set_history_interval(1e-3);
    backend->internal_forces(force);
    backend->commit_history();
    backend->internal_forces(after);
    for (std::size_t i = 0; i < force.size(); ++i) {
      scale = std::max(scale, norm(force[i]));
      apart = std::max(apart, norm(after[i] - force[i]));
    }
  }
  EXPECT_LE(apart, 1e-10 * scale);  // rounding of trial stresses some ten times as large
}

/// Momenta of a body that flies, turns and flows.
TEST_P(FlowLaws, MomentaAreKept) {
  Scene scene = one_body(material());
  scene.bodies[0].material.hourglass = 0.1;
  const Model model = model_of(scene, lattice(6, 5, 4, 0.1, 0.1));
  State start = initial_state(model, scene, 0.4 * step_limit(model).largest_step);
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d x = model.position[i];
    start.velocity[i] = {3 * x.y, -2 * x.z, 0.5 + x.x * x.y};  // strains itself by more than 1%
  }
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(*backend, start);
  const Diagnostics before = diagnose(model, *backend, solver.now());
  solver.step(300);
  const Diagnostics after = diagnose(model, *backend, solver.now());
  EXPECT_GT(heat_of(after), 0);
  // Rounding of 300 steps.
  EXPECT_LE(norm(after.momentum - before.momentum), 1e-12 * norm(before.momentum));
  EXPECT_LE(norm(after.angular_momentum - before.angular_momentum),
            1e-11 * norm(before.angular_momentum));
}

TEST_P(FlowLaws, ARestartInTheMiddleOfFlowHasTheSameBits) {
  Material m = material();
  m.viscosity = 5e-4;
  const Impact impact(m);
  for (const Precision precision : all_precisions) {
    const auto one = make_test_backend(impact.model, precision),
               other = make_test_backend(impact.model, precision);
    Solver whole(*one, impact.start(impact.dt));
    whole.step(57);
    const State middle = whole.state();
    whole.step(43);
    Solver resumed(*other, middle);
    resumed.step(43);
    EXPECT_TRUE(whole.state().displacement == resumed.state().displacement);
    EXPECT_TRUE(whole.state().velocity == resumed.state().velocity);
    EXPECT_TRUE(whole.state().history == resumed.state().history);
  }
}

TEST_P(FlowLaws, ThreadsDoNotChangeTheBits) {
  const Impact impact(material());
  for (const Precision precision : all_precisions) {
    State first;
    for (const int threads : {1, 2, 3}) {
      const auto backend = make_test_backend(impact.model, precision, threads);
      Solver solver(*backend, impact.start(impact.dt));
      solver.step(80);
      if (threads == 1) first = solver.state();
      EXPECT_TRUE(solver.state().displacement == first.displacement) << threads;
      EXPECT_TRUE(solver.state().history == first.history) << threads;
    }
  }
}

/// Implicit steps go to where Verlet's do, as fast as their length shrinks.
TEST_P(FlowLaws, ImplicitStepsConvergeToVerlets) {
  Impact impact(material(), -0.4);
  const double end = 0.02;
  const auto run = [&](Method method, int steps) {
    const auto backend = make_test_backend(impact.model, Precision::double_);
    Scene scene = impact.scene;
    scene.solver.method = method;
    Solver solver(impact.model, *backend, initial_state(impact.model, scene, end / steps), method);
    solver.step(steps);
    EXPECT_GT(heat_of(diagnose(impact.model, *backend, solver.now())), 0);
    return solver.state().displacement;
  };
  const std::vector<Vec3d> truth =
      run(Method::verlet, static_cast<int>(std::ceil(end / (0.01 * impact.dt))));
  const auto error = [&](int steps) {
    const std::vector<Vec3d> found = run(Method::implicit, steps);
    double most = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      most = std::max(most, norm(found[i] - truth[i]));
    }
    return most;
  };
  const double coarse = error(8), fine = error(64);
  // The end moves by 8 mm. First order at least, as yielding begins within steps: an eighth of the
  // step, about an eighth of the error; seen: a seventh with clay, a fifteenth with metals.
  EXPECT_LE(fine, 4e-5);
  EXPECT_GE(coarse / fine, 6);
}

INSTANTIATE_TEST_SUITE_P(Laws, FlowLaws,
                         ::testing::Values(std::pair{"Curve", by_curve()},
                                           std::pair{"JohnsonCook", by_rate()},
                                           std::pair{"Clay", clay()},
                                           std::pair{"Maxwell", relaxing()}),
                         [](const auto& test) { return std::string(test.param.first); });

/// A block that is sheared without a change of volume: in the endless time of a search for rest the
/// flow stress is that of slow tests, and heat is gone; in a step it is that of the rate; in no
/// time nothing flows.
TEST(JohnsonCookAtRest, KnowsNoRate) {
  Material m = by_rate();
  const Model model = model_of(one_body(m), lattice(5, 4, 4, 0.1, 0.2));
  const auto flow_after = [&](double interval) {
    const auto backend = make_test_backend(model, Precision::double_);
    backend->upload(state_of(std::vector<Vec3d>(model.position.size())));
    std::vector<Vec3d> u;
    for (const Vec3d& x : model.position) u.push_back({0.1 * x.y, 0, 0});
    backend->put_displacements(u);
    backend->set_history_interval(interval);
    std::vector<double> von_mises, ratio;
    stress_fields(model, *backend, &von_mises, &ratio);
    backend->commit_history();
    State state;
    backend->download(state);
    const double strain = state.history[6].values[0];
    EXPECT_EQ(state.history[7].values[0] > 0, interval == 1e-4);  // the rise of temperature
    return std::pair{von_mises[0], strain};
  };
  // In the first step the material is as cold as it began.
  const auto [slow, slow_strain] = flow_after(endless_time);
  // Rounding of a stress of E times a strain of 0.1 over one of 1%.
  EXPECT_NEAR(slow / (1e3 + 3e3 * std::sqrt(slow_strain)), 1, 1e-12);
  const auto [fast, strain] = flow_after(1e-4);
  EXPECT_NEAR(fast / ((1e3 + 3e3 * std::sqrt(strain)) * (1 + 0.1 * std::log(strain / 1e-4 / 0.05))),
              1, 1e-12);
  EXPECT_EQ(flow_after(0).second, 0);
}

/// A sheared block of clay: in the endless time of a search for rest, the elastic strain that is
/// left is the yield strain, however slow creep is; in no time nothing creeps.
TEST(ClayAtRest, HasCreptForEver) {
  Material m = clay();
  m.parameters["creep_time"] = 1e6;
  const Model model = model_of(one_body(m), lattice(5, 4, 4, 0.1, 0.2));
  const auto backend = make_test_backend(model, Precision::double_);
  std::vector<Vec3d> u;
  for (const Vec3d& x : model.position) u.push_back({0.1 * x.y, 0, 0});
  const auto plastic_after = [&](double interval) {
    backend->upload(state_of(std::vector<Vec3d>(model.position.size())));
    backend->put_displacements(u);
    backend->set_history_interval(interval);
    backend->commit_history();
    State state;
    backend->download(state);
    return state.history[1].values[0];  // xy
  };
  EXPECT_LE(plastic_after(1), 1e-7);  // a millionth of the excess of 0.06
  // E has 0.05 in xy and 0.005 in yy, of a deviator's length 0.0708; 0.01 of it stays elastic.
  const double length = std::sqrt(2 * 0.05 * 0.05 + 2.0 / 3 * 0.005 * 0.005);
  EXPECT_NEAR(plastic_after(endless_time), 0.05 * (1 - 0.01 / length), 1e-15);
  EXPECT_EQ(plastic_after(0), 0);
}

/// A sheared block: in the endless time of a search for rest three tenths of the shear stress are
/// left; in no time all of it is there.
TEST(MaxwellAtRest, HasRelaxed) {
  const Model model = model_of(one_body(relaxing()), lattice(5, 4, 4, 0.1, 0.2));
  const auto backend = make_test_backend(model, Precision::double_);
  std::vector<Vec3d> u;
  for (const Vec3d& x : model.position) u.push_back({0.1 * x.y, 0, 0});
  const auto stress_after = [&](double interval) {
    backend->upload(state_of(std::vector<Vec3d>(model.position.size())));
    backend->put_displacements(u);
    backend->set_history_interval(interval);
    std::vector<double> von_mises, ratio;
    stress_fields(model, *backend, &von_mises, &ratio);
    return von_mises[0];
  };
  EXPECT_NEAR(stress_after(endless_time) / stress_after(0), 0.3, 1e-12);  // rounding
}

}  // namespace
}  // namespace phyxel
