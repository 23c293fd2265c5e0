/// The cantilever of `bench cantilever`: its deflection, and the table.
#include "cantilever.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/model.hpp"
#include "support/program.hpp"

namespace phyxel {
namespace {

using app::cantilever_scene;
using app::settle;
using app::Settled;
using ::testing::HasSubstr;

constexpr double factor = 1.4;  // 18 interior neighbours, for the least work
constexpr int threads = 1;      // more threads wait for each other on a busy machine

Settled settled(int across, Precision precision, std::int64_t frames = 0) {
  const Scene scene = cantilever_scene(across, factor);
  const Model model = build_model(scene);
  return settle(scene, model, *make_cpu_backend(model, precision, threads), frames);
}

TEST(Cantilever, TimoshenkosFormulaByHand) {
  // I = 0.1⁴/12, so bending takes 0.025/(3 · 10⁶ I) = 10⁻³ m; shear takes 0.025/(κ A G) with
  // κ = 13/15.3 and A G = 0.01 · 10⁶/2.6.
  EXPECT_NEAR(app::timoshenko_deflection(), 1e-3 + 7.65e-6, 1e-12);
}

TEST(Cantilever, ConvergesToTheKnownDeflectionWithSecondOrder) {
  const auto error = [](int across) {
    return settled(across, Precision::single).deflection / app::known_deflection() - 1;
  };
  const double coarse = error(3), fine = error(5);
  EXPECT_GT(fine, 0);  // too soft, since the fit at a surface phyxel is one-sided
  // Terms of higher order add a fifth at 3 across, which raises the order by at most 0.3.
  EXPECT_NEAR(std::log(coarse / fine) / std::log(5.0 / 3.0), 2, 0.3);
  // Without the effect of the fixed face, 0.66% here, this would be 0.063.
  EXPECT_NEAR(fine, 0.070, 0.003);
}

TEST(Cantilever, PrecisionsDifferByRounding) {
  const Settled exact = settled(3, Precision::double_);
  for (const Precision precision : {Precision::single, Precision::mixed}) {
    const Settled rounded = settled(3, precision, exact.frames);
    EXPECT_EQ(rounded.steps, exact.steps) << precision_name(precision);
    // Lattice and moments are rounded to 6e-8; a strain, a small difference of displacements, loses
    // at most two digits.
    const double rounding = std::abs(rounded.deflection / exact.deflection - 1);
    EXPECT_GT(rounding, 0) << precision_name(precision);
    EXPECT_LT(rounding, 6e-6) << precision_name(precision);
  }
}

TEST(Cantilever, TheHeldLayerCarriesTheShear) {
  const Scene scene = cantilever_scene(3, factor);
  const Model model = build_model(scene);
  const auto backend = make_cpu_backend(model, Precision::double_, threads);
  settle(scene, model, *backend);
  std::vector<Vec3d> force;
  backend->internal_forces(force);
  double reaction = 0;
  for (const Index i : model.motions[0].phyxels) reaction += force[i].z;
  // Settled to some millionths.
  EXPECT_NEAR(reaction, -app::cantilever_shear, 1e-5 * app::cantilever_shear);
}

TEST(Cantilever, SaysSoIfItDoesNotSettle) {
  Scene scene = cantilever_scene(3, factor);
  scene.time.end /= 40;
  const Model model = build_model(scene);
  const auto backend = make_cpu_backend(model, Precision::single, threads);
  try {
    settle(scene, model, *backend);
    FAIL() << "settled";
  } catch (const DivergedError& error) {
    EXPECT_THAT(error.what(), HasSubstr("3 across"));
    EXPECT_THAT(error.what(), HasSubstr("not settled"));
    EXPECT_THAT(error.what(), HasSubstr("allowed 1e-06"));
  }
}

class CantileverBench : public test::Program {};

/// Double is measured even if only float is requested, as the reference of float.
TEST_F(CantileverBench, MeasuresDoubleBesideWhatIsAskedFor) {
  const test::Outcome bench = run({"bench", "cantilever", "--device", "cpu", "--across", "2,3",
                                   "--factor", "1.4", "--precision", "float"});
  ASSERT_EQ(bench.code, 0) << bench.err;
  EXPECT_THAT(bench.out, HasSubstr("\n3,1.4,double,"));
  EXPECT_THAT(bench.out, HasSubstr("\n3,1.4,float,"));
}

}  // namespace
}  // namespace phyxel
