/// Laws of the caller's own, and views of the state.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "phyxel/custom_law.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/solver.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

constexpr Precision all_precisions[] = {Precision::single, Precision::double_, Precision::mixed};

/// ψ = a / 2 (exp(E : S / a) - 1) of Green's strain, as in Fung, Fronek and Patitucci 1979.
class Exponential final : public CustomLaw {
 public:
  explicit Exponential(const Material& m) : hooke_{m.lame_lambda(), m.lame_mu()}, scale_(m.young) {}
  std::string name() const override { return "exponential"; }
  double energy(const Mat3d& grad_u) const override {
    return 0.5 * scale_ * std::expm1(2 * hooke_.energy(green_strain(grad_u)) / scale_);
  }
  Mat3d first_piola_stress(const Mat3d& grad_u) const override {
    const Sym3d strain = green_strain(grad_u);
    const double growth = std::exp(2 * hooke_.energy(strain) / scale_);
    return growth * ((identity<double>() + grad_u) * full(hooke_.stress(strain)));
  }

 private:
  Hooke<double> hooke_;
  double scale_;  // [Pa]
};

/// Forgets what `Repeated` knows at rest, or by how much energy grows.
class Wrong final : public CustomLaw {
 public:
  Wrong(double at_rest, double factor) : at_rest_(at_rest), factor_(factor) {}
  std::string name() const override { return "wrong"; }
  double energy(const Mat3d& grad_u) const override { return Repeated(rubber()).energy(grad_u); }
  Mat3d first_piola_stress(const Mat3d& grad_u) const override {
    return at_rest_ * identity<double>() + factor_ * Repeated(rubber()).first_piola_stress(grad_u);
  }

 private:
  double at_rest_, factor_;
};

Material with_law(std::shared_ptr<const CustomLaw> law) {
  Material material = rubber();
  material.custom_law = std::move(law);
  return material;
}

Model irregular_model(const Material& material) {
  return model_of(one_body(material), lattice(5, 4, 6, 0.1, 0.25));
}

struct Answer {
  std::vector<Vec3d> force;
  Diagnostics diagnostics;
  std::vector<double> von_mises;
};

Answer answer_of(const Model& model, const std::vector<Vec3d>& u, Precision precision) {
  const auto backend = make_cpu_backend(model, precision, 2);
  backend->upload(state_of(u));
  Answer answer;
  backend->internal_forces(answer.force);
  answer.diagnostics = diagnose(model, *backend, 0, 1e-3);
  stress_fields(model, *backend, &answer.von_mises, nullptr);
  return answer;
}

TEST(CustomLaw, ThatRepeatsNeoHookeGivesItsAnswers) {
  Material material = rubber();
  material.volume_stiffness = 2e5;
  material.hourglass = 0.1;
  material.law = "neo-hookean";
  const Model built_in = irregular_model(material);
  material.custom_law = std::make_shared<Repeated>(material);
  const Model custom = irregular_model(material);
  const std::vector<Vec3d> u = random_deformation(built_in, 0.01);
  for (const Precision precision : all_precisions) {
    const Answer expected = answer_of(built_in, u, precision),
                 got = answer_of(custom, u, precision);
    // In float the built-in law rounds each of its operations.
    const double tolerance = precision == Precision::double_ ? 1e-14 : 1e-6;
    const double scale = expected.diagnostics.force_scale / built_in.size();
    for (Index i = 0; i < built_in.size(); ++i) {
      EXPECT_LT(norm(got.force[i] - expected.force[i]), 10 * tolerance * scale);
      EXPECT_NEAR(got.von_mises[i], expected.von_mises[i], 1e-6 * expected.von_mises[i]);
    }
    EXPECT_NEAR(got.diagnostics.strain_energy, expected.diagnostics.strain_energy,
                1e-12 * expected.diagnostics.strain_energy);  // both in double
  }
}

TEST(CustomLaw, ForceIsMinusTheGradientOfTheReportedEnergy) {
  Material material = with_law(std::make_shared<Exponential>(rubber()));
  material.volume_stiffness = 1e5;
  Scene scene = one_body(material);
  scene.bodies[0].inclusions = {
      {.select = {.ball = Selection::Ball{{0.25, 0.2, 0.3}, 0.2}}, .material = rubber()}};
  const Model model = model_of(scene, lattice(5, 4, 6, 0.1, 0.25));
  ASSERT_EQ(model.parts.size(), 2u);
  std::vector<Vec3d> u = random_deformation(model, 0.01);
  const Answer here = answer_of(model, u, Precision::double_);
  const double scale = here.diagnostics.force_scale / model.size();
  // As in force_test: differences over 1e-6 m leave 1e-9 of the force.
  const double step = 1e-6;
  for (const std::size_t i : {0u, 7u, 33u, 61u, 87u, 119u}) {
    for (double Vec3d::*axis : {&Vec3d::x, &Vec3d::y, &Vec3d::z}) {
      const double at = u[i].*axis;
      const auto energy_at = [&](double place) {
        u[i].*axis = place;
        return answer_of(model, u, Precision::double_).diagnostics.elastic_energy();
      };
      const double slope = (energy_at(at + step) - energy_at(at - step)) / (2 * step);
      u[i].*axis = at;
      EXPECT_NEAR(here.force[i].*axis, -slope, 1e-6 * scale);
    }
  }
}

TEST(CustomLaw, StepLimitIsThatOfTheLaw) {
  Material material = rubber();
  material.law = "neo-hookean";
  const double built_in = step_limit(irregular_model(material)).omega_max;
  material.custom_law = std::make_shared<Repeated>(material, 4);
  const Model stiff = irregular_model(material);
  const StepLimit limit = step_limit(stiff);
  // A start by rounding: the same iteration, but for its last digits.
  EXPECT_NEAR(limit.omega_max, 2 * built_in, 1e-6 * built_in);
  const auto backend = make_cpu_backend(stiff, Precision::single);
  EXPECT_EQ(step_limit(stiff, *backend).omega_max, limit.omega_max);
}

TEST(CustomLaw, EnergyStaysBoundedBelowTheStepLimit) {
  Scene scene = one_body(with_law(std::make_shared<Exponential>(rubber())));
  scene.bodies[0].spin = {0.5, 1, 0};
  const Model model = model_of(scene, lattice(5, 4, 4, 0.1, 0.2));
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto backend = make_cpu_backend(model, Precision::double_);
  Solver solver(*backend, initial_state(model, scene, dt));
  const double start = diagnose(model, *backend, solver.now()).total_energy();
  double worst = 0;
  for (int k = 0; k < 2000; ++k) {
    solver.step();
    if (k % 50 != 0) continue;
    worst =
        std::max(worst, std::abs(diagnose(model, *backend, solver.now()).total_energy() - start));
  }
  EXPECT_LT(worst, 0.01 * start);  // Verlet's own: (ω dt)² / 8 of what rings, a few percent of all
}

TEST(CustomLaw, ThatCannotBeSteppedIsRefused) {
  const auto message_of = [](double at_rest, double factor) -> std::string {
    try {
      irregular_model(with_law(std::make_shared<Wrong>(at_rest, factor)));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message_of(0, 1), "");
  EXPECT_THAT(message_of(10, 1), HasSubstr("law \"wrong\": its stress (0, 0) at rest is 10 Pa"));
  EXPECT_THAT(message_of(0, 1.01),
              HasSubstr("allowed is a stress that is the energy's derivative"));
  EXPECT_THAT(message_of(0, NAN), HasSubstr("law \"wrong\": its stress (0, 0) at rest is nan"));
}

/// Fails once it is stretched by more than it knows, on whichever thread.
class Limited final : public CustomLaw {
 public:
  std::string name() const override { return "limited"; }
  double energy(const Mat3d& grad_u) const override {
    check(grad_u);
    return Repeated(rubber()).energy(grad_u);
  }
  Mat3d first_piola_stress(const Mat3d& grad_u) const override {
    check(grad_u);
    return Repeated(rubber()).first_piola_stress(grad_u);
  }

 private:
  static void check(const Mat3d& grad_u) {
    if (grad_u(0, 0) > 0.2) throw std::range_error("stretched too far");
  }
};

TEST(CustomLaw, WhatItThrowsReachesTheCallerAndTheStateStays) {
  const Model model = irregular_model(with_law(std::make_shared<Limited>()));
  std::vector<Vec3d> stretched;
  for (const Vec3d& x : model.position) stretched.push_back({0.3 * x.x, 0, 0});
  for (const Precision precision : all_precisions) {
    const auto backend = make_cpu_backend(model, precision, 2);
    Solver solver(*backend, state_of(stretched, 1e-4));
    EXPECT_THROW(solver.step(), std::range_error);
    EXPECT_EQ(solver.steps(), 0);
    EXPECT_NEAR(solver.state().displacement[1].x, stretched[1].x, 1e-7);
    std::vector<Vec3d> force;
    EXPECT_THROW(backend->internal_forces(force), std::range_error);
    std::vector<double> von_mises;
    EXPECT_THROW(stress_fields(model, *backend, &von_mises, nullptr), std::range_error);
    // And it goes on from a state that the law knows.
    backend->upload(state_of(std::vector<Vec3d>(stretched.size()), 1e-4));
    EXPECT_NO_THROW(backend->step(0, 1e-4));
    EXPECT_NO_THROW(diagnose(model, *backend, solver.now()));
  }
}

/// Energies alone may fail, too.
TEST(CustomLaw, WhatItsEnergyThrowsReachesTheCaller) {
  class NoEnergy final : public CustomLaw {
   public:
    explicit NoEnergy(const bool& fails) : fails_(fails) {}
    std::string name() const override { return "no energy"; }
    double energy(const Mat3d& grad_u) const override {
      if (fails_) throw std::domain_error("no energy");
      return Repeated(rubber()).energy(grad_u);
    }
    Mat3d first_piola_stress(const Mat3d& grad_u) const override {
      return Repeated(rubber()).first_piola_stress(grad_u);
    }

   private:
    const bool& fails_;
  };
  bool fails = false;
  const Model model = irregular_model(with_law(std::make_shared<NoEnergy>(fails)));
  const auto backend = make_cpu_backend(model, Precision::double_, 2);
  backend->upload(state_of(std::vector<Vec3d>(model.position.size())));
  fails = true;
  EXPECT_THROW(diagnose(model, *backend, 0, 1e-3), std::domain_error);
  fails = false;
  EXPECT_NO_THROW(diagnose(model, *backend, 0, 1e-3));
}

TEST(CustomLaw, IsOfTheModelsDigest) {
  const auto digest_of = [](double factor) {
    return model_digest(irregular_model(with_law(std::make_shared<Repeated>(rubber(), factor))));
  };
  EXPECT_EQ(digest_of(1), digest_of(1));
  EXPECT_NE(digest_of(1), digest_of(2));
  EXPECT_NE(digest_of(1), model_digest(irregular_model(rubber())));
}

TEST(StateView, ShowsWhatADownloadCopies) {
  const Cloud block = lattice(7, 3, 4, 0.1, 0.1);
  Scene scene = one_body();
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].fixed.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {0.1, 1, 1}}}});
  scene.bodies.push_back(scene.bodies[0]);  // of which the second begins in a pack of its own
  scene.bodies[1].name = "second";
  const Cloud clouds[] = {block, block};
  const Model model = build_model(scene, clouds);
  for (const Precision precision : all_precisions) {
    const auto backend = make_cpu_backend(model, precision);
    Solver solver(*backend, initial_state(model, scene, 1e-3));
    const std::optional<StateView> view = backend->view();
    ASSERT_TRUE(view);
    EXPECT_EQ(view->single, precision == Precision::single);
    solver.step(20);
    const State copy = solver.state();
    for (Index i = 0; i < model.size(); ++i) {
      EXPECT_EQ(view->displacement(i), copy.displacement[i]);
      EXPECT_EQ(view->velocity(i), copy.velocity[i]);
      EXPECT_LT(view->slot[i], view->packs * view->lanes);
    }
  }
}

}  // namespace
}  // namespace phyxel
