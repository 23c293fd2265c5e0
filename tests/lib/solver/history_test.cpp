/// Bodies whose laws remember: steps commit history, evaluations do not, the energy that plastic
/// and viscous work take is accounted for, and a restart goes on to the bit.
#include "phyxel/history.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

constexpr Precision all_precisions[] = {Precision::single, Precision::mixed, Precision::double_};

/// Metal as soft as rubber, that yields at a strain of 1%.
Material soft_metal() {
  Material m = rubber();
  m.law = "j2";
  m.parameters = {{"yield_stress", 1e3}, {"hardening", 5e3}};
  return m;
}

/// A bar along x that moves into what holds its low end, and is squeezed beyond yield.
struct Impact {
  explicit Impact(const Material& material, double speed = -0.8) {
    scene = one_body(material);
    scene.bodies[0].velocity = {speed, 0, 0};
    scene.bodies[0].material.hourglass = 0.1;
    Selection low;
    low.box = Selection::Box{{-1, -1, -1}, {0.05, 1, 1}};
    scene.bodies[0].fixed.push_back({low, {true, false, false}});
    cloud = lattice(12, 4, 4, 0.1);
    model = model_of(scene, cloud);
    dt = 0.5 * step_limit(model).largest_step;
  }
  Scene scene;
  Cloud cloud;
  Model model;
  double dt = 0;
};

TEST(History, ColumnsAreThoseOfTheLawAndOfViscosity) {
  Material m = soft_metal();
  EXPECT_EQ(history_columns(model_of(one_body(m), lattice(3, 3, 3, 0.1))).size(), 7u);
  m.viscosity = 1e-3;
  const std::vector<std::string> columns =
      history_columns(model_of(one_body(m), lattice(3, 3, 3, 0.1)));
  EXPECT_EQ(columns.size(), 14u);
  EXPECT_EQ(columns[6], "equivalent_plastic_strain");
  EXPECT_EQ(columns.back(), "viscous_work");
  EXPECT_TRUE(history_columns(model_of(one_body(), lattice(3, 3, 3, 0.1))).empty());
}

/// What an elastic scene never pays for: no array, no bytes of a step.
TEST(History, OfElasticLawsTakesNoMemory) {
  const Model elastic = model_of(one_body(), lattice(5, 5, 5, 0.1)),
              plastic = model_of(one_body(soft_metal()), lattice(5, 5, 5, 0.1));
  const auto bytes_of = [](Backend& backend) {
    std::size_t bytes = 0;
    for (const ArrayBytes& array : backend.memory()) {
      if (array.name == "history") bytes += array.bytes;
    }
    return bytes;
  };
  const auto one = make_test_backend(elastic, Precision::double_),
             other = make_test_backend(plastic, Precision::double_);
  EXPECT_EQ(bytes_of(*one), 0u);
  EXPECT_GE(bytes_of(*other), 125 * 7 * sizeof(double));
  EXPECT_GT(other->step_traffic(), one->step_traffic());
  State state;
  one->download(state);
  EXPECT_TRUE(state.history.empty());
}

/// Forces, gradients, residuals, energies, stress fields, looks at stiffening and the step limit
/// leave a body in the middle of flow as it was.
TEST(History, EvaluationsNeverCommit) {
  Material m = soft_metal();
  m.viscosity = 1e-3;
  const Impact impact(m);
  for (const Precision precision : all_precisions) {
    const auto backend = make_test_backend(impact.model, precision);
    Solver solver(*backend, initial_state(impact.model, impact.scene, impact.dt));
    solver.step(60);
    const State before = solver.state();
    ASSERT_GT(*std::max_element(before.history[6].values.begin(), before.history[6].values.end()),
              1e-3);
    const auto expect_untouched = [&](const char* verb) {
      const State now = solver.state();
      EXPECT_TRUE(now.history == before.history) << verb;
      EXPECT_EQ(now.history_interval, before.history_interval) << verb;
      EXPECT_TRUE(now.displacement == before.displacement) << verb;
    };
    std::vector<Vec3d> force, again;
    backend->internal_forces(force);
    expect_untouched("internal_forces");
    backend->internal_forces(again);
    EXPECT_TRUE(force == again);
    backend->internal_forces(again, HistoryUse::frozen);
    expect_untouched("frozen forces");
    std::vector<Mat3d> gradient;
    backend->displacement_gradients(gradient);
    expect_untouched("displacement_gradients");
    std::vector<double> residual, von_mises, volume_ratio;
    backend->fit_residuals(residual);
    expect_untouched("fit_residuals");
    const Diagnostics energies = diagnose(impact.model, *backend, solver.now());
    EXPECT_GT(energies.plastic_work, 0);
    EXPECT_GT(energies.viscous_work, 0);
    expect_untouched("diagnose");
    EXPECT_EQ(diagnose(impact.model, *backend, solver.now()).plastic_work, energies.plastic_work);
    stress_fields(impact.model, *backend, &von_mises, &volume_ratio);
    expect_untouched("stress_fields");
    find_stiffening(impact.model, *backend);
    expect_untouched("find_stiffening");
    present_step_limit(impact.model, *backend);
    expect_untouched("present_step_limit");
    SurfelState surfels;
    backend->advect_surfels(surfels);
    expect_untouched("advect_surfels");
    // And the next step is that of a run that was never looked at.
    const auto unseen = make_test_backend(impact.model, precision);
    Solver other(*unseen, initial_state(impact.model, impact.scene, impact.dt));
    other.step(80);
    solver.step(20);
    EXPECT_TRUE(solver.state().displacement == other.state().displacement);
    EXPECT_TRUE(solver.state().history == other.state().history);
  }
}

/// Forces are the derivative of the energy that is stored, while the history stays.
TEST(History, FrozenForcesAreTheDerivativeOfTheStoredEnergy) {
  const Impact impact(soft_metal());
  const auto backend = make_test_backend(impact.model, Precision::double_);
  Solver solver(*backend, initial_state(impact.model, impact.scene, impact.dt));
  solver.step(80);
  State state = solver.state();
  // The trial of a diagnosis must not flow either: far below the flow stress of a hardened twin.
  Material strong = soft_metal();
  strong.parameters["yield_stress"] = 1e9;
  Scene scene = impact.scene;
  scene.bodies[0].material = strong;
  scene.bodies[0].material.hourglass = 0;
  const Model elastic = model_of(scene, impact.cloud);
  const auto twin = make_test_backend(elastic, Precision::double_);
  const auto energy_at = [&](const State& at) {
    twin->upload(at);
    return diagnose(elastic, *twin, 0, 1).strain_energy;
  };
  twin->upload(state);
  std::vector<Vec3d> force;
  twin->internal_forces(force, HistoryUse::frozen);
  double largest = 0;
  for (const Vec3d& f : force) largest = std::max(largest, norm(f));
  for (const Index i : {0, 31, 77, 150}) {
    for (int axis = 0; axis < 3; ++axis) {
      const double step = 1e-6;
      State ahead = state, behind = state;
      (&ahead.displacement[i].x)[axis] += step;
      (&behind.displacement[i].x)[axis] -= step;
      const double slope = (energy_at(ahead) - energy_at(behind)) / (2 * step);
      // Central differences at 1e-5 of a spacing: 1e-10; rounding of an energy of 0.1 J: 1e-11 N.
      EXPECT_NEAR((&force[i].x)[axis], -slope, 1e-6 * largest);
    }
  }
}

/// Elastic, kinetic, plastic and viscous energy of a body that is crushed and comes to rest.
TEST(History, TheEnergyLedgerIsClosed) {
  for (const double viscosity : {0.0, 2e-4}) {
    Material m = soft_metal();
    m.viscosity = viscosity;
    const Impact impact(m, -0.4);
    const auto worst_in_steps_of = [&](double dt) {
      const auto backend = make_test_backend(impact.model, Precision::double_);
      Solver solver(*backend, initial_state(impact.model, impact.scene, dt));
      const double start = diagnose(impact.model, *backend, solver.now()).total_energy();
      double worst = 0;
      Diagnostics now;
      while (solver.time() < 0.25) {
        solver.step(40);
        now = diagnose(impact.model, *backend, solver.now());
        worst = std::max(worst, std::abs(now.total_energy() / start - 1));
      }
      EXPECT_GT(now.plastic_work, 0.2 * start);
      if (viscosity > 0) {
        EXPECT_GT(now.viscous_work, 0.01 * start);
      }
      return worst;
    };
    const double coarse = worst_in_steps_of(0.5 * impact.dt),
                 fine = worst_in_steps_of(0.25 * impact.dt);
    // It falls at least as fast as the step, measured: as its square. What is left is the step's.
    EXPECT_LE(fine, 1e-3) << viscosity;
    EXPECT_GE(coarse / fine, 1.8) << viscosity;
  }
}

TEST(History, MomentaAreKeptWhileABodyFlows) {
  Material m = soft_metal();
  m.viscosity = 1e-3;
  Scene scene = one_body(m);
  scene.bodies[0].material.hourglass = 0.1;
  const Model model = model_of(scene, lattice(6, 5, 4, 0.1, 0.1));
  const double dt = 0.4 * step_limit(model).largest_step;
  State start = initial_state(model, scene, dt);
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d x = model.position[i];
    start.velocity[i] = {3 * x.y, -2 * x.z, 0.5 + x.x * x.y};  // strains itself by more than 1%
  }
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(*backend, start);
  const Diagnostics before = diagnose(model, *backend, solver.now());
  solver.step(300);
  const Diagnostics after = diagnose(model, *backend, solver.now());
  EXPECT_GT(after.plastic_work, 0);
  // Rounding of 300 steps.
  EXPECT_LE(norm(after.momentum - before.momentum), 1e-12 * norm(before.momentum));
  EXPECT_LE(norm(after.angular_momentum - before.angular_momentum),
            1e-11 * norm(before.angular_momentum));
}

/// A run in the middle of flow, stopped, written, read and continued, has the bits of one that was
/// not.
TEST(History, ARestartInTheMiddleOfFlowHasTheSameBits) {
  Material m = soft_metal();
  m.viscosity = 5e-4;
  const Impact impact(m);
  for (const Precision precision : all_precisions) {
    const auto one = make_test_backend(impact.model, precision),
               other = make_test_backend(impact.model, precision);
    Solver whole(*one, initial_state(impact.model, impact.scene, impact.dt));
    whole.step(57);
    const State middle = whole.state();
    whole.step(43);
    Solver resumed(*other, middle);
    resumed.step(43);
    EXPECT_TRUE(whole.state().displacement == resumed.state().displacement);
    EXPECT_TRUE(whole.state().velocity == resumed.state().velocity);
    EXPECT_TRUE(whole.state().history == resumed.state().history);
    // And a state whose history is lost does not.
    State lost = middle;
    lost.history.clear();
    Solver virgin(*other, lost);
    virgin.step(43);
    EXPECT_FALSE(whole.state().displacement == virgin.state().displacement);
  }
}

TEST(History, OfOtherLawsIsRefusedByName) {
  const Model plastic = model_of(one_body(soft_metal()), lattice(3, 3, 3, 0.1)),
              elastic = model_of(one_body(), lattice(3, 3, 3, 0.1));
  State state = state_of(std::vector<Vec3d>(27), 1e-4);
  state.history = virgin_history(plastic);
  const auto refusal = [](const Model& model, const State& s) -> std::string {
    try {
      make_test_backend(model, Precision::double_)->upload(s);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal(plastic, state), "accepted");
  EXPECT_THAT(refusal(elastic, state), HasSubstr("column \"inverse_plastic_factor_xx\" found"));
  State bad = state;
  bad.history.pop_back();
  EXPECT_THAT(refusal(plastic, bad), HasSubstr("\"equivalent_plastic_strain\" is missing"));
  bad = state;
  bad.history[2].values.pop_back();
  EXPECT_THAT(refusal(plastic, bad), HasSubstr("has 26 values for 27 phyxels"));
  bad = state;
  bad.history[6].values[11] = std::nan("");
  EXPECT_THAT(refusal(plastic, bad), HasSubstr("is not finite at phyxel 11"));
}

/// A block pulled and pushed beyond yield carries the closed form's stress: uniaxial stress is
/// σ₀ + H ε̄ in Kirchhoff's measure, whatever the cycles before.
TEST(History, ABlockUnderUniaxialCyclesHasTheClosedForm) {
  const Material m = soft_metal();
  const Model model = model_of(one_body(m), lattice(5, 4, 4, 0.1, 0.2));
  const double yield = 1e3, hardening = 5e3;
  for (const Precision precision : all_precisions) {
    const auto backend = make_test_backend(model, precision);
    backend->upload(state_of(std::vector<Vec3d>(model.position.size())));
    double equivalent = 0, plastic = 0;  // of the closed form
    for (const double stretch : {0.03, 0.06, 0.02, -0.03, 0.05, 0.09, 0.0}) {
      // In logarithmic strain; the sides follow by Poisson's ratio, and by half of what has flown.
      const double strain = std::log1p(stretch), trial = m.young * (strain - plastic);
      const double excess = std::abs(trial) - (yield + hardening * equivalent);
      if (excess > 0) {
        const double increment = excess / (m.young + hardening);
        equivalent += increment;
        plastic += trial > 0 ? increment : -increment;
      }
      const double elastic = strain - plastic, kirchhoff = m.young * elastic;
      const double side = std::expm1(-m.poisson * elastic - 0.5 * plastic);
      std::vector<Vec3d> u;
      for (const Vec3d& x : model.position) u.push_back({stretch * x.x, side * x.y, side * x.z});
      backend->put_displacements(u);
      backend->commit_history();
      State state;
      backend->download(state);
      std::vector<double> von_mises, ratio;
      stress_fields(model, *backend, &von_mises, &ratio);
      // Rounding of strains of some percent over a yield strain of one.
      const double tolerance = precision == Precision::double_ ? 1e-10 : 3e-5;
      for (std::size_t i = 0; i < u.size(); ++i) {
        EXPECT_NEAR(state.history[6].values[i] / equivalent, 1, tolerance);
        // Cauchy's measure: over the change of volume.
        EXPECT_NEAR(von_mises[i] * ratio[i] / std::abs(kirchhoff), 1, tolerance) << stretch;
      }
    }
  }
}

TEST(History, ACallersLawMayRememberToo) {
  Material own = soft_metal();
  own.viscosity = 3e-4;
  own.volume_stiffness = 2e4;
  Material borrowed = own;
  borrowed.custom_law = std::make_shared<Borrowed>(own);
  Impact one(own), other(borrowed);
  for (Impact* impact : {&one, &other}) {  // of other moduli
    impact->scene.bodies[0].material.hourglass = 0;
    impact->model = model_of(impact->scene, impact->cloud);
  }
  const auto backend = make_cpu_backend(one.model, Precision::double_, 2),
             custom = make_cpu_backend(other.model, Precision::double_, 2);
  Solver solver(*backend, initial_state(one.model, one.scene, one.dt)),
      repeated(*custom, initial_state(other.model, other.scene, one.dt));
  solver.step(100), repeated.step(100);
  const State a = solver.state(), b = repeated.state();
  ASSERT_EQ(a.history.size(), b.history.size());
  for (std::size_t i = 0; i < a.displacement.size(); ++i) {
    // Sums of three stresses in another order, over 100 steps.
    EXPECT_LE(norm(a.displacement[i] - b.displacement[i]), 1e-12);
    EXPECT_NEAR(a.history[6].values[i], b.history[6].values[i], 1e-10);
  }
  const Diagnostics x = diagnose(one.model, *backend, solver.now()),
                    y = diagnose(other.model, *custom, repeated.now());
  EXPECT_NEAR(x.plastic_work, y.plastic_work, 1e-9 * x.plastic_work);
  EXPECT_NEAR(x.viscous_work, y.viscous_work, 1e-9 * x.viscous_work);
  EXPECT_NEAR(x.volume_energy, y.volume_energy, 1e-9 * x.volume_energy);
}

/// What a caller's law throws in the middle of a pass leaves the history of before.
TEST(History, ALawThatThrowsCommitsNothing) {
  class Fragile final : public CustomLaw {
   public:
    std::string name() const override { return "fragile"; }
    double energy(const Mat3d& g) const override {
      return 5e4 * contract(cauchy_strain(g), cauchy_strain(g));
    }
    Mat3d first_piola_stress(const Mat3d& g) const override { return 1e5 * full(cauchy_strain(g)); }
    std::vector<std::string> history() const override { return {"evaluations"}; }
    Mat3d first_piola_stress(const Mat3d& g, std::span<double> numbers, double) const override {
      numbers[0] += 1;
      if (g(0, 0) > 0.3) throw std::range_error("torn");
      return first_piola_stress(g);
    }
  };
  Material m = rubber();
  m.custom_law = std::make_shared<Fragile>();
  const Model model = model_of(one_body(m), lattice(6, 6, 6, 0.1));
  const auto backend = make_cpu_backend(model, Precision::double_, 2);
  std::vector<Vec3d> u(216);
  u[200].x = 0.2;
  backend->upload(state_of(u, 1e-4));
  EXPECT_THROW(backend->step(0, 1e-4), std::range_error);
  State state;
  backend->download(state);
  for (const double count : state.history[0].values) EXPECT_EQ(count, 0);
}

/// The amplitude of a free bar's first mode falls by π τ ω / √(1 - (τω/2)²) a period.
TEST(History, KelvinVoigtDampsABarsModeAsTheFormulaSays) {
  Material m = rubber();
  m.poisson = 0;
  m.law = "hencky";
  const double length = 1.2, spacing = 0.1;  // of cells
  const Cloud cloud = lattice(12, 3, 3, spacing);
  const double omega = std::numbers::pi / length * std::sqrt(m.young / m.density);
  m.viscosity = 0.04 / omega;  // ξ = 0.02
  Scene scene = one_body(m);
  const Model model = model_of(scene, cloud);
  const double dt = 0.3 * step_limit(model).largest_step;
  State start = initial_state(model, scene, dt);
  const auto mode = [&](Index i) {
    return std::sin(std::numbers::pi * (model.position[i].x / length - 0.5));
  };
  for (Index i = 0; i < model.size(); ++i) {
    start.displacement[i].x = 1e-4 * mode(i);
  }
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(*backend, start);
  const auto projection = [&] {
    const State now = solver.state();
    double sum = 0;
    for (Index i = 0; i < model.size(); ++i) {
      sum += model.mass[i] * now.displacement[i].x * mode(i);
    }
    return sum;
  };
  // Peaks of the projection, by parabolas.
  std::vector<double> peak, when;
  double a = projection(), b = a;
  while (peak.size() < 5) {
    solver.step();
    const double c = projection();
    if (b > a && b >= c && solver.steps() > 5) {
      const double bend = a - 2 * b + c, shift = 0.5 * (a - c) / bend;
      peak.push_back(b - 0.25 * (a - c) * shift);
      when.push_back(solver.time() - dt + shift * dt);
    }
    a = b, b = c;
  }
  // From the second peak on, when higher modes have died. The body's own frequency, which the
  // spacing shifts by some percent.
  const double damped = 2 * std::numbers::pi * 3 / (when[4] - when[1]);
  const double tau = m.viscosity, own = damped * (1 + tau * tau * damped * damped / 8);
  const double expected = std::numbers::pi * tau * own / std::sqrt(1 - tau * tau * own * own / 4);
  EXPECT_NEAR(std::log(peak[1] / peak[4]) / 3 / expected, 1, 1e-2);
}

}  // namespace
}  // namespace phyxel
