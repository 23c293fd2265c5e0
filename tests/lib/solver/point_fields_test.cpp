/// Computed fields of phyxels: stress and strain tensors of a uniform deformation, and marks of the
/// boundary.
#include "phyxel/point_fields.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/state.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::ElementsAre;

/// St Venant-Kirchhoff's law under F = R U, U = diag(1.2, 0.9, 1) and R a quarter turn about z that
/// takes x to y: S = λ tr(E) I + 2 μ E, σ = F S Fᵀ / det F.
TEST(PointFields, AreTensorsOfAUniformDeformation) {
  const Cloud cloud = lattice(5, 5, 5, 0.1, 0.2);
  Scene scene = one_body();
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  State state;
  for (const Vec3d x : model.position) {
    state.displacement.push_back(Vec3d{-0.9 * x.y, 1.2 * x.x, x.z} - x);
    state.velocity.push_back({});
  }
  backend->upload(state);
  const Quantity wanted[] = {Quantity::stress, Quantity::principal_stress, Quantity::strain,
                             Quantity::von_mises, Quantity::volume_ratio};
  const FieldValues fields = find_fields(model, *backend, wanted);
  const double lame = 1e5 * 0.3 / (1.3 * 0.4), shear = 1e5 / 2.6, ratio = 1.2 * 0.9;
  const double ex = (1.2 * 1.2 - 1) / 2, ey = (0.9 * 0.9 - 1) / 2, trace = ex + ey;
  const double along_x = 1.44 / ratio * (lame * trace + 2 * shear * ex),
               along_y = 0.81 / ratio * (lame * trace + 2 * shear * ey),
               along_z = lame * trace / ratio;
  // In space, what was along x is along y.
  const double stress[6] = {along_y, along_x, along_z, 0, 0, 0};
  const double strain[6] = {ex, ey, 0, 0, 0, 0};
  const double principal[3] = {along_x, along_z, along_y};
  for (Index i = 0; i < model.size(); ++i) {
    for (int k = 0; k < 6; ++k) {
      EXPECT_NEAR(fields.at(Quantity::stress)[6 * i + k], stress[k], 1e-7);
      EXPECT_NEAR(fields.at(Quantity::strain)[6 * i + k], strain[k], 1e-12);
    }
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(fields.at(Quantity::principal_stress)[3 * i + k], principal[k], 1e-7);
    }
    EXPECT_NEAR(fields.at(Quantity::volume_ratio)[i], ratio, 1e-12);
    EXPECT_NEAR(fields.at(Quantity::von_mises)[i],
                std::sqrt(0.5 * (std::pow(along_x - along_y, 2) + std::pow(along_y - along_z, 2) +
                                 std::pow(along_z - along_x, 2))),
                1e-7);
  }
}

/// Simple shear has off-diagonal components: u_x = γ y, u_z = δ x, small.
TEST(PointFields, HaveTheirShearComponentsInOrder) {
  const Cloud cloud = lattice(4, 4, 4, 0.1);
  Scene scene = one_body();
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  State state;
  for (const Vec3d x : model.position) {
    state.displacement.push_back({1e-6 * x.y, 4e-6 * x.z, 2e-6 * x.x});
    state.velocity.push_back({});
  }
  backend->upload(state);
  const Quantity wanted[] = {Quantity::strain};
  const std::vector<double> strain = find_fields(model, *backend, wanted).at(Quantity::strain);
  // xy, yz, xz; quadratic terms are 1e-11.
  EXPECT_NEAR(strain[3], 0.5e-6, 1e-10);
  EXPECT_NEAR(strain[4], 2e-6, 1e-10);
  EXPECT_NEAR(strain[5], 1e-6, 1e-10);
}

TEST(PointFields, MarkTheBoundary) {
  const Cloud cloud = lattice(6, 1, 1, 0.1);
  Scene scene = one_body();
  const auto only = [](std::vector<Index> phyxels) {
    Selection select;
    select.indices = std::move(phyxels);
    return select;
  };
  scene.bodies[0].fixed = {{.select = only({0}), .axes = {true, false, false}}};
  scene.bodies[0].motions = {{.select = only({1, 2}), .velocity = {1, 0, 0}}};
  scene.bodies[0].loads = {{.select = only({0, 2, 4}), .force = {1, 0, 0}}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  const Quantity wanted[] = {Quantity::boundary};
  EXPECT_THAT(find_fields(model, *backend, wanted).at(Quantity::boundary),
              ElementsAre(5, 2, 6, 0, 4, 0));
}

TEST(PointFields, AreThoseThatTheOutputNames) {
  OutputRequest output;
  EXPECT_TRUE(wanted_fields(output).empty());
  output.fields = {"boundary", "mass", "stress"};
  EXPECT_THAT(wanted_fields(output), ElementsAre(Quantity::stress, Quantity::boundary));
}

}  // namespace
}  // namespace phyxel
