/// The GPU solver against the CPU solver, on bodies of many tiles with every term. (The physics
/// itself is tested by the CPU's tests, which also run on the GPU: cuda.*)
#include "solver/cuda_backend.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cuda_cases.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

class CudaBackend : public ::testing::TestWithParam<Case> {};

TEST_P(CudaBackend, ForcesAndGradientsEqualTheCpus) {
  const Model model = model_of_case(GetParam());
  const State state = state_of(random_deformation(model, 0.005));
  const auto cpu = make_cpu_backend(model, Precision::double_);
  cpu->upload(state);
  std::vector<Vec3d> expected, force;
  std::vector<Mat3d> expected_gradient, gradient;
  cpu->internal_forces(expected);
  cpu->displacement_gradients(expected_gradient);
  // As for the CPU's own: 40 neighbours' roundings through an inverse matrix.
  const std::pair<Precision, double> cases[] = {
      {Precision::double_, 1e-12}, {Precision::single, 3e-5}, {Precision::mixed, 3e-5}};
  for (const auto& [precision, tolerance] : cases) {
    const auto gpu = make_test_backend(model, precision);
    gpu->upload(state);
    gpu->internal_forces(force);
    gpu->displacement_gradients(gradient);
    EXPECT_LT(apart(force, expected), tolerance);
    double worst = 0;
    for (std::size_t i = 0; i < gradient.size(); ++i) {
      for (int e = 0; e < 9; ++e) {
        worst = std::max(worst,
                         std::abs(gradient[i](e / 3, e % 3) - expected_gradient[i](e / 3, e % 3)));
      }
    }
    EXPECT_LT(worst, tolerance);
  }
}

TEST_P(CudaBackend, TrajectoriesStayWithTheCpus) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto cpu = make_cpu_backend(model, Precision::double_);
  const State expected = after(*cpu, model, scene, dt, 300);
  // 300 steps: 1e-16 and 6e-8 a step, grown by the motion some tenfold.
  const std::pair<Precision, double> cases[] = {
      {Precision::double_, 1e-12}, {Precision::single, 3e-4}, {Precision::mixed, 3e-4}};
  for (const auto& [precision, tolerance] : cases) {
    const auto gpu = make_test_backend(model, precision);
    const State found = after(*gpu, model, scene, dt, 300);
    EXPECT_LT(apart(found.displacement, expected.displacement), tolerance);
    EXPECT_LT(apart(found.velocity, expected.velocity), 30 * tolerance);
    ASSERT_EQ(found.history.size(), expected.history.size());
    for (std::size_t k = 0; k < found.history.size(); ++k) {
      const std::vector<double>&a = found.history[k].values, &b = expected.history[k].values;
      double worst = 0, most = 0;
      for (std::size_t i = 0; i < b.size(); ++i) {
        worst = std::max(worst, std::abs(a[i] - b[i]));
        most = std::max(most, std::abs(b[i]));
      }
      EXPECT_LT(worst, 30 * tolerance * most) << found.history[k].name;
      EXPECT_GT(most, 0) << found.history[k].name;
    }
  }
}

TEST_P(CudaBackend, TwoRunsAndARestartAreBitwiseEqual) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  for (const Precision precision : {Precision::single, Precision::double_, Precision::mixed}) {
    const auto first = make_test_backend(model, precision),
               second = make_test_backend(model, precision);
    const State whole = after(*first, model, scene, dt, 200);
    Solver begun(*second, initial_state(model, scene, dt));
    for (int s = 0; s < 77; ++s) begun.step();
    const State middle = begun.state();
    const auto third = make_test_backend(model, precision);
    Solver rest(*third, middle);
    while (rest.steps() < 200) rest.step();
    EXPECT_TRUE(rest.state().displacement == whole.displacement);
    EXPECT_TRUE(rest.state().velocity == whole.velocity);
    EXPECT_TRUE(rest.state().history == whole.history);
  }
}

/// The limit at a deformed state is that of the host, and looking for it changes no bit of what
/// comes after.
TEST_P(CudaBackend, TheLimitOfADeformedStateIsTheHosts) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto cpu = make_cpu_backend(model, Precision::double_);
  // Rounding, in double; in float, forces lose three digits in the difference, and the iteration
  // may end one earlier or later, at 2% either way.
  const std::pair<Precision, double> cases[] = {
      {Precision::double_, 1e-6}, {Precision::single, 0.02}, {Precision::mixed, 0.02}};
  for (const auto& [precision, tolerance] : cases) {
    const auto gpu = make_test_backend(model, precision),
               unbroken = make_test_backend(model, precision);
    const State start = initial_state(model, scene, dt);
    Solver solver(*gpu, start), other(*unbroken, start);
    for (int s = 0; s < 60; ++s) {
      if (s == 40) {
        const State middle = solver.state();
        const double found = present_step_limit(model, *gpu).omega_max;
        cpu->upload(middle);
        const double expected = present_step_limit(model, *cpu).omega_max;
        EXPECT_NEAR(found, expected, tolerance * expected);
        EXPECT_TRUE(solver.state().displacement == middle.displacement);
      }
      solver.step();
      other.step();
    }
    EXPECT_TRUE(solver.state().displacement == other.state().displacement);
    EXPECT_TRUE(solver.state().velocity == other.state().velocity);
    EXPECT_TRUE(solver.state().history == other.state().history);
  }
}

TEST_P(CudaBackend, EnergiesAndMomentaEqualTheHosts) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto cpu = make_cpu_backend(model, Precision::double_);
  const auto gpu = make_test_backend(model, Precision::double_);
  const State state = after(*cpu, model, scene, dt, 150);
  gpu->upload(state);
  const Diagnostics e = diagnose(model, *cpu, 150, dt), d = diagnose(model, *gpu, 150, dt);
  EXPECT_EQ(d.step, 150);
  EXPECT_EQ(d.time, 150 * dt);
  // Sums of 4,323 terms in another order.
  const double energy = e.kinetic_energy + e.strain_energy;
  EXPECT_NEAR(d.kinetic_energy, e.kinetic_energy, 1e-12 * energy);
  EXPECT_NEAR(d.strain_energy, e.strain_energy, 1e-12 * energy);
  EXPECT_NEAR(d.volume_energy, e.volume_energy, 1e-12 * energy);
  EXPECT_NEAR(d.hourglass_energy, e.hourglass_energy, 1e-12 * energy);
  EXPECT_EQ(e.hourglass_energy > 0, GetParam().everything && !GetParam().adaptive);
  EXPECT_NEAR(d.gravity_energy, e.gravity_energy, 1e-12 * energy);
  EXPECT_NEAR(d.load_energy, e.load_energy, 1e-12 * energy);
  EXPECT_GT(e.kinetic_energy, 0.1 * energy);
  EXPECT_LT(norm(d.momentum - e.momentum), 1e-12 * norm(e.momentum));
  EXPECT_LT(norm(d.angular_momentum - e.angular_momentum), 1e-12 * norm(e.angular_momentum));
  EXPECT_NEAR(d.force_scale, e.force_scale, 1e-11 * e.force_scale);
  EXPECT_NEAR(d.torque_scale, e.torque_scale, 1e-11 * e.torque_scale);
  EXPECT_LT(norm(d.internal_force), 1e-12 * e.force_scale);
  EXPECT_NEAR(d.largest_speed, e.largest_speed, 1e-12 * e.largest_speed);
  EXPECT_NEAR(d.largest_displacement, e.largest_displacement, 1e-12 * e.largest_displacement);
  EXPECT_EQ(d.fastest_phyxel, e.fastest_phyxel);
  EXPECT_EQ(d.bad_phyxel, -1);
  EXPECT_EQ(d.inverted, e.inverted);

  State broken = state;
  broken.displacement[1234].y = std::nan("");
  gpu->put(broken);
  const Diagnostics bad = diagnose(model, *gpu, 150, dt);
  ASSERT_GE(bad.bad_phyxel, 0);  // it, or a neighbour that its NaN has reached
  EXPECT_LT(norm(model.position[bad.bad_phyxel] - model.position[1234]), 1);
}

INSTANTIATE_TEST_SUITE_P(
    Terms, CudaBackend,
    ::testing::Values(
        Case{"Uniform", false, false, false}, Case{"Adaptive", true, false, false},
        Case{"Capped", true, true, false}, Case{"UniformEverything", false, false, true},
        Case{"AdaptiveEverything", true, false, true}, Case{"Closed", false, false, false, true},
        Case{"ClosedEverything", false, false, true, true},
        Case{"ClosedBesideAdaptive", false, false, true, true, true},
        Case{"Inclusions", false, false, true, false, false, true},
        Case{"Plastic", false, false, true, false, false, false, true},
        Case{"PlasticViscous", false, false, false, false, false, true, true, true},
        Case{"ClosedPlasticViscous", false, false, true, true, false, false, true, true},
        Case{.name = "Pairs", .pairs = true},
        Case{.name = "PairsEverything", .everything = true, .pairs = true},
        Case{.name = "PairsBesideAdaptive", .everything = true, .one_each = true, .pairs = true},
        Case{.name = "ClosedPairs", .everything = true, .closed = true, .pairs = true},
        Case{.name = "ClosedPairsBesideAdaptive",
             .everything = true,
             .closed = true,
             .one_each = true,
             .pairs = true},
        Case{.name = "PairsInclusions", .everything = true, .inclusions = true, .pairs = true},
        Case{.name = "PairsPlasticViscous",
             .everything = true,
             .plastic = true,
             .viscous = true,
             .pairs = true}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(CudaSurfels, EqualTheCpus) {
  const Model model = built_in_bodies("dino", "alien_head");
  const State state = state_of(random_deformation(model, 0.001));
  const auto cpu = make_cpu_backend(model, Precision::double_);
  cpu->upload(state);
  SurfelState expected, found;
  cpu->advect_surfels(expected);
  const double size = largest(expected.position);
  for (const auto& [precision, tolerance] :
       {std::pair{Precision::double_, 1e-13}, std::pair{Precision::single, 3e-6}}) {
    const auto gpu = make_test_backend(model, precision);
    gpu->upload(state);
    gpu->advect_surfels(found);
    ASSERT_EQ(found.position.size(), expected.position.size());
    double off = 0, turned = 0;
    for (std::size_t s = 0; s < found.position.size(); ++s) {
      off = std::max(off, norm(found.position[s] - expected.position[s]) / size);
      turned = std::max(turned, norm(found.normal[s] - expected.normal[s]));
    }
    EXPECT_LT(off, tolerance);
    EXPECT_LT(turned, 30 * tolerance);  // normals come from gradients
  }
}

TEST(CudaMemory, TermsThatAreOffTakeNone) {
  const auto names = [](const Model& model, Precision precision) {
    std::vector<std::string> list;
    const auto backend = make_test_backend(model, precision);
    for (const ArrayBytes& array : backend->memory()) list.push_back(array.name);
    return list;
  };
  using ::testing::AnyOf;
  using ::testing::Contains;
  using ::testing::Not;
  EXPECT_THAT(names(model_of(one_body(), lattice(8, 8, 8, 0.1)), Precision::single),
              Not(Contains(AnyOf("loads", "supports", "inverse neighbour lists", "displacements",
                                 "surfels"))));
  EXPECT_THAT(
      names(model_of_case({"", true, true, true}), Precision::mixed),
      ::testing::IsSupersetOf({"loads", "supports", "inverse neighbour lists", "displacements"}));
}

TEST(CudaRefusal, OfWhatIsTheCallersOwn) {
  const auto refusal_of = [](auto&& work) -> std::string {
    try {
      work();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  using ::testing::HasSubstr;
  const Cloud cloud = lattice(8, 8, 8, 0.1);
  Material material = rubber();
  material.custom_law = std::make_shared<Repeated>(material);
  const Model custom = model_of(one_body(material), cloud), ours = model_of(one_body(), cloud);
  EXPECT_THAT(refusal_of([&] { make_test_backend(custom, Precision::single); }),
              HasSubstr("body \"body\": custom_law = \"repeated"));
  const auto backend = make_test_backend(ours, Precision::single);
  EXPECT_FALSE(backend->view());
}

}  // namespace
}  // namespace phyxel
