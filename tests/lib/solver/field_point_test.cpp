/// What fields show of a phyxel on the surface whose material yields or is viscous.
#include "solver/field_point.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/clouds.hpp"
#include "support/j2.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// A simple shear of γ in the plane of x and z, whose normal along y has next to no traction.
Mat3d shear(double gamma) {
  Mat3d g;
  g(0, 2) = gamma;
  return g;
}

/// Copper that hardens, so that its stress tells how far it has yielded.
Material hardening_metal() {
  j2::J2Parameters parameters = j2::linear;
  parameters.hardening = 20;
  Material metal = parameters;
  metal.density = 1;
  return metal;
}

/// The point of a phyxel that was sheared in 50 steps.
FieldPoint sheared(const PartLaw& law, double gamma) {
  std::vector<double> history(7);
  for (int step = 1; step <= 50; ++step) law.after_step(shear(gamma * step / 50), history, 1);
  return own_point(law, shear(gamma), history, 1);
}

constexpr int equivalent_plastic_strain = 6;

/// Where the recovered gradient is larger, the material has yielded further, and where it is
/// smaller, less far: as if it had been sheared so from the start.
TEST(FieldPoint, HasYieldedAsFarAsItsGradientSays) {
  const Material metal = hardening_metal();
  const PartLaw law(metal);
  const FieldPoint own = sheared(law, 0.05);
  for (const double gamma : {0.045, 0.055}) {
    const FieldPoint right = sheared(law, gamma),
                     found = recovered_point(law, own, shear(gamma), {0, 1, 0}, 1);
    const auto stress = [](const FieldPoint& p) { return p.first_piola_stress(0, 2); };
    const auto plastic = [](const FieldPoint& p) { return p.history[equivalent_plastic_strain]; };
    EXPECT_NEAR(stress(found) - stress(own), stress(right) - stress(own),
                0.02 * std::abs(stress(right) - stress(own)))
        << gamma;
    EXPECT_NEAR(plastic(found) - plastic(own), plastic(right) - plastic(own),
                0.02 * std::abs(plastic(right) - plastic(own)))
        << gamma;
    EXPECT_NEAR(found.grad_u(0, 2), gamma, 1e-5);
  }
}

/// After unloading the difference is elastic both ways, and nothing yields.
TEST(FieldPoint, IsElasticAfterUnloading) {
  const Material metal = hardening_metal();
  const PartLaw law(metal);
  std::vector<double> history = sheared(law, 0.05).history;
  law.after_step(shear(0.048), history, 1);
  const FieldPoint own = own_point(law, shear(0.048), history, 1);
  const double mu = metal.lame_mu();
  for (const double change : {-5e-4, 5e-4}) {
    const FieldPoint found = recovered_point(law, own, shear(0.048 + change), {0, 1, 0}, 1);
    EXPECT_NEAR(found.first_piola_stress(0, 2) - own.first_piola_stress(0, 2), mu * change,
                0.02 * mu * std::abs(change));
    EXPECT_EQ(found.history, own.history);
  }
}

/// A viscous stress follows the own rate: the recovered gradient changes the elastic one alone,
/// however short the step is.
TEST(FieldPoint, KeepsViscousStresses) {
  Material material = rubber();
  material.law = "small-strain";
  material.viscosity = 0.1;
  const PartLaw law(material);
  std::vector<double> history(7);
  const double dt = 1e-9;
  law.after_step(shear(0.01 - 1e-9), history, dt);
  const FieldPoint own = own_point(law, shear(0.01), history, dt);
  const double mu = material.lame_mu();
  ASSERT_NEAR(own.first_piola_stress(0, 2), mu * (0.01 + 0.1), 0.01 * mu);
  const FieldPoint found = recovered_point(law, own, shear(0.012), {0, 1, 0}, 1);
  EXPECT_NEAR(found.first_piola_stress(0, 2) - own.first_piola_stress(0, 2), mu * 0.002,
              1e-3 * mu * 0.002);
}

/// Half a share is half the way; a gradient that would turn the phyxel inside out is not taken.
TEST(FieldPoint, IsTheOwnOneWhereTheRecoveredOneCannotBe) {
  const Material material = rubber();
  const PartLaw law(material);
  const FieldPoint own = own_point(law, shear(0.01), {}, 0);
  EXPECT_NEAR(recovered_point(law, own, shear(0.02), {0, 1, 0}, 0.5).grad_u(0, 2), 0.015, 1e-6);
  Mat3d crushed = shear(0.01);
  crushed(0, 0) = -0.6;
  const FieldPoint kept = recovered_point(law, own, crushed, {0, 1, 0}, 1);
  EXPECT_EQ(kept.first_piola_stress(0, 2), own.first_piola_stress(0, 2));
  EXPECT_EQ(kept.grad_u(0, 0), 0);
}

}  // namespace
}  // namespace phyxel
