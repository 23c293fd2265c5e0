/// What is told of a state against closed forms of homogeneous deformations.
#include "phyxel/diagnostics.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "phyxel/physics/laws.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

struct Fields {
  std::vector<double> von_mises, volume_ratio;
};

/// The fields where every phyxel is moved from x to F x.
Fields fields_of(const Model& model, const Mat3d& f) {
  const auto backend = make_test_backend(model, Precision::double_);
  std::vector<Vec3d> u;
  for (const Vec3d& x : model.position) u.push_back(f * x - x);
  backend->upload(state_of(u));
  Fields fields;
  stress_fields(model, *backend, &fields.von_mises, &fields.volume_ratio);
  return fields;
}

/// A turn about an axis askew to the body.
Mat3d turn() {
  const double a = 0.7, b = -1.1;
  Mat3d about_z = identity<double>(), about_x = identity<double>();
  about_z(0, 0) = about_z(1, 1) = std::cos(a);
  about_z(0, 1) = -std::sin(a), about_z(1, 0) = std::sin(a);
  about_x(1, 1) = about_x(2, 2) = std::cos(b);
  about_x(1, 2) = -std::sin(b), about_x(2, 1) = std::sin(b);
  return about_z * about_x;
}

Mat3d stretched(const std::array<double, 3>& stretch) {
  Mat3d u;
  for (int k = 0; k < 3; ++k) u(k, k) = stretch[k];
  return u;
}

/// Von Mises' measure of principal stresses, from their differences: no mean is taken.
double von_mises_of(const std::array<double, 3>& s) {
  return std::sqrt(
      0.5 * (std::pow(s[0] - s[1], 2) + std::pow(s[1] - s[2], 2) + std::pow(s[2] - s[0], 2)));
}

/// True (Cauchy) stresses of principal stretches l under St. Venant and Kirchhoff's law:
/// σ_k = l_k² (λ tr E + 2 μ E_k) / (l_1 l_2 l_3), E_k = (l_k² - 1) / 2.
std::array<double, 3> true_stresses(const Material& m, const std::array<double, 3>& stretch) {
  std::array<double, 3> strain{}, stress{};
  for (int k = 0; k < 3; ++k) strain[k] = (stretch[k] * stretch[k] - 1) / 2;
  const double trace = strain[0] + strain[1] + strain[2];
  const double volume = stretch[0] * stretch[1] * stretch[2];
  for (int k = 0; k < 3; ++k) {
    stress[k] =
        stretch[k] * stretch[k] * (m.lame_lambda() * trace + 2 * m.lame_mu() * strain[k]) / volume;
  }
  return stress;
}

TEST(StressFields, OfPrincipalStretchesAreVonMises) {
  const Model model = model_of(one_body(), lattice(4, 5, 3, 0.1, 0.2));
  const Material& material = model.parts[0].material;
  for (const std::array<double, 3>& stretch :
       {std::array{1.3, 0.9, 0.8}, std::array{0.8, 1.3, 0.9}, std::array{0.9, 0.8, 1.3},
        std::array{1.5, 1.5, 1.0}, std::array{1.0, 1.0, 0.6}}) {
    const double expected = von_mises_of(true_stresses(material, stretch));
    const double volume = stretch[0] * stretch[1] * stretch[2];
    for (const Mat3d& rotation : {identity<double>(), turn()}) {
      const Fields fields = fields_of(model, rotation * stretched(stretch));
      for (Index i = 0; i < model.size(); ++i) {
        // A fit of a linear field is exact but for rounding, times the moments' conditions.
        ASSERT_NEAR(fields.von_mises[i], expected, 1e-11 * material.young);
        ASSERT_NEAR(fields.volume_ratio[i], volume, 1e-12);
      }
    }
  }
}

/// Pressure alone is no von Mises stress, however high, with what keeps volumes, too.
TEST(StressFields, OfPressureVanish) {
  Material material = rubber();
  material.volume_stiffness = 2e5;
  const Model model = model_of(one_body(material), lattice(4, 5, 3, 0.1, 0.2));
  for (const double stretch : {0.7, 1.4}) {
    const Fields fields = fields_of(model, stretch * turn());
    for (Index i = 0; i < model.size(); ++i) {
      ASSERT_NEAR(fields.von_mises[i], 0, 1e-11 * material.young);
      ASSERT_NEAR(fields.volume_ratio[i], std::pow(stretch, 3), 1e-12);
    }
  }
}

}  // namespace
}  // namespace phyxel
