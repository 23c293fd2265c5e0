/// What fields show of a phyxel on the surface whose gradient is recovered.
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
const Vec3d along_y{0, 1, 0};

Material metal() {
  Material metal = j2::perfect;
  metal.density = 1;
  return metal;
}

/// Before it yields, a metal has the stress of the recovered gradient, up to its yield stress.
TEST(FieldPoint, OfAMetalIsThatOfTheRecoveredGradientUntilItYields) {
  const Material copper = metal();
  const PartLaw law(copper);
  const std::vector<double> virgin(7);
  const FieldPoint own = own_point(law, shear(0.004), virgin, 1);
  const double mu = copper.lame_mu();
  const auto shear_stress = [&](double gamma) {
    return recovered_point(law, own, virgin, shear(gamma), along_y, 1).first_piola_stress(0, 2);
  };
  EXPECT_NEAR(shear_stress(0.0044), mu * 0.0044, 1e-4 * mu * 0.0044);
  EXPECT_NEAR(shear_stress(0.008), 0.4 / std::sqrt(3), 1e-4 * 0.4);
}

/// Once it has yielded it keeps its own point: how much of the difference to another gradient is
/// elastic is not known, least of all while it unloads.
TEST(FieldPoint, OfAMetalThatHasYieldedIsItsOwn) {
  const Material copper = metal();
  const PartLaw law(copper);
  std::vector<double> history(7);
  history[6] = 0.02;  // equivalent_plastic_strain
  const FieldPoint own = own_point(law, shear(0.001), history, 1);
  for (const double gamma : {0.0009, 0.0011, 0.002}) {
    const FieldPoint found = recovered_point(law, own, history, shear(gamma), along_y, 1);
    EXPECT_EQ(found.first_piola_stress(0, 2), own.first_piola_stress(0, 2));
    EXPECT_EQ(found.grad_u(0, 2), 0.001);
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
  const double dt = 1e-9, mu = material.lame_mu();
  history[2] = 0.5 * (0.01 - dt);                // last_strain_xz
  history[5] = 0.5 * (0.01 - dt) * (0.01 - dt);  // last_strain_zz
  const FieldPoint own = own_point(law, shear(0.01), history, dt);
  ASSERT_NEAR(own.first_piola_stress(0, 2), mu * (0.01 + 0.1), 0.01 * mu);
  const FieldPoint found = recovered_point(law, own, history, shear(0.012), along_y, 1);
  EXPECT_NEAR(found.first_piola_stress(0, 2) - own.first_piola_stress(0, 2), mu * 0.002,
              1e-3 * mu * 0.002);
}

/// Half a share is half the way; a gradient that would turn the phyxel inside out is not taken.
TEST(FieldPoint, IsTheOwnOneWhereTheRecoveredOneCannotBe) {
  const Material material = rubber();
  const PartLaw law(material);
  const FieldPoint own = own_point(law, shear(0.01), {}, 0);
  EXPECT_NEAR(recovered_point(law, own, {}, shear(0.02), along_y, 0.5).grad_u(0, 2), 0.015, 1e-6);
  Mat3d crushed = shear(0.01);
  crushed(0, 0) = -0.6;
  const FieldPoint kept = recovered_point(law, own, {}, crushed, along_y, 1);
  EXPECT_EQ(kept.first_piola_stress(0, 2), own.first_piola_stress(0, 2));
  EXPECT_EQ(kept.grad_u(0, 0), 0);
}

}  // namespace
}  // namespace phyxel
