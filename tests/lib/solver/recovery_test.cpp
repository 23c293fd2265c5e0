/// Recovered gradients: exact for affine displacements, and of second order everywhere.
#include "phyxel/recovery.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/equilibrium.hpp"
#include "phyxel/history.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/point_fields.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/j2.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// A displacement u_k = g x + ½ xᵀ H_k x, and its gradient.
struct Quadratic {
  Mat3d slope{};
  std::array<Sym3d, 3> curvature{};
  Vec3d at(Vec3d x) const {
    const Vec3d bend{dot(x, curvature[0] * x), dot(x, curvature[1] * x), dot(x, curvature[2] * x)};
    return slope * x + 0.5 * bend;
  }
  Mat3d gradient(Vec3d x) const {
    Mat3d g = slope;
    for (int k = 0; k < 3; ++k) {
      const Vec3d row = curvature[k] * x;
      g(k, 0) += row.x;
      g(k, 1) += row.y;
      g(k, 2) += row.z;
    }
    return g;
  }
};
Quadratic some_quadratic(double slope, double curvature) {
  std::mt19937_64 engine(3);
  Quadratic found;
  for (int e = 0; e < 9; ++e) found.slope(e / 3, e % 3) = uniform(engine, -slope, slope);
  for (Sym3d& h : found.curvature) {
    const auto some = [&] { return uniform(engine, -curvature, curvature); };
    h = {some(), some(), some(), some(), some(), some()};
  }
  return found;
}

double largest_entry(const Mat3d& m) {
  double largest = 0;
  for (int e = 0; e < 9; ++e) largest = std::max(largest, std::abs(m(e / 3, e % 3)));
  return largest;
}

std::vector<Vec3d> displaced(const Model& model, const Quadratic& by) {
  std::vector<Vec3d> u;
  for (const Vec3d x : model.position) u.push_back(by.at(x));
  return u;
}
double largest_error(const Model& model, const Quadratic& by, const std::vector<Mat3d>& found) {
  double largest = 0;
  for (Index i = 0; i < model.size(); ++i) {
    largest = std::max(largest, largest_entry(found[i] - by.gradient(model.position[i])));
  }
  return largest;
}
std::vector<Mat3d> own_gradients(const Model& model, const std::vector<Vec3d>& u) {
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(u));
  std::vector<Mat3d> own;
  backend->displacement_gradients(own);
  return own;
}

Model model_of_mesh(Index phyxels) {
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.4, 0.5}), {.phyxels = phyxels});
  return build_model(one_body(), std::span(&cloud, 1));
}

TEST(Recovery, KeepsAffineDisplacements) {
  const Model model = model_of_mesh(1000);
  const Quadratic affine = some_quadratic(1e-2, 0);
  EXPECT_LT(largest_error(model, affine, Recovery(model).gradients(displaced(model, affine))),
            1e-14);
}

/// The fit's error on the surface is about a third of the support times the second derivative; four
/// sweeps leave a twentieth of that, at corners and edges, too.
TEST(Recovery, IsOfSecondOrderOnTheSurface) {
  const Model model = model_of_mesh(1000);
  const Quadratic bent = some_quadratic(1e-2, 1e-2);
  const std::vector<Vec3d> u = displaced(model, bent);
  const double before = largest_error(model, bent, own_gradients(model, u)),
               after = largest_error(model, bent, Recovery(model).gradients(u));
  EXPECT_GT(before, 0.3 * 1e-2 * model.neighbourhood.support[0]);
  EXPECT_LT(after, 0.06 * before);  // seen: 0.042
}

/// Of a cubic displacement the error falls with the square of the spacing; that of the fit alone,
/// with the spacing.
TEST(Recovery, ConvergesWithTheSquareOfTheSpacing) {
  const auto error_at = [](Index phyxels, bool recovers) {
    const Model model = model_of_mesh(phyxels);
    std::vector<Vec3d> u;
    for (const Vec3d x : model.position) u.push_back({0, 1e-2 * x.x * x.x * x.x, 0});
    const std::vector<Mat3d> found =
        recovers ? Recovery(model).gradients(u) : own_gradients(model, u);
    double squares = 0;
    Index count = 0;
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d x = model.position[i];
      if (x.x < 1 - 1e-6) continue;
      squares += std::pow(found[i](1, 0) - 3e-2 * x.x * x.x, 2);
      ++count;
    }
    return std::sqrt(squares / count);
  };
  const double ratio = std::cbrt(8.0);  // of spacings
  const double order = std::log(error_at(500, true) / error_at(4000, true)) / std::log(ratio),
               order_of_fit =
                   std::log(error_at(500, false) / error_at(4000, false)) / std::log(ratio);
  EXPECT_GT(order, 1.9);  // seen: 2.2
  EXPECT_LT(order_of_fit, 1.3);
}

/// Where the material changes, gradients jump: each side has its own.
TEST(Recovery, DoesNotLookAcrossMaterials) {
  const Cloud cloud = lattice(12, 5, 5, 0.1);
  Scene scene = one_body();
  Selection half;
  half.box = Selection::Box{{0.6, -1, -1}, {2, 1, 1}};
  Material stiff = scene.bodies[0].material;
  stiff.young *= 10;
  scene.bodies[0].inclusions = {{.select = half, .material = stiff}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  ASSERT_EQ(model.parts.size(), 2u);
  std::vector<Vec3d> u;
  const double kink = 0.6;
  for (const Vec3d x : model.position) {
    u.push_back({x.x < kink ? 1e-2 * x.x : 1e-2 * kink + 1e-3 * (x.x - kink), 0, 0});
  }
  const std::vector<Mat3d> found = Recovery(model).gradients(u);
  for (Index i = 0; i < model.size(); ++i) {
    EXPECT_NEAR(found[i](0, 0), model.position[i].x < kink ? 1e-2 : 1e-3, 1e-14);
  }
}

/// The largest difference of a field from what it would be without recovery.
double largest_change(const Scene& scene, const Cloud& cloud, const Quadratic& by, Quantity field) {
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(displaced(model, by)));
  const Recovery recovery(model);
  const std::vector<double> own = find_fields(model, *backend, {&field, 1}).at(field),
                            better = find_fields(model, *backend, {&field, 1}, &recovery).at(field);
  double largest = 0;
  for (std::size_t k = 0; k < own.size(); ++k) {
    largest = std::max(largest, std::abs(own[k] - better[k]));
  }
  return largest;
}

/// Fields follow, those of materials with a history, too, but not those of a layer of one phyxel of
/// another material, whose neighbours of its own kind do not tell how it stretches across.
TEST(Recovery, ServesFields) {
  Scene scene = one_body();
  const Cloud cloud = lattice(7, 6, 6, 0.1);
  const Quadratic bent = some_quadratic(1e-2, 1e-2);
  const double young = scene.bodies[0].material.young;
  EXPECT_GT(largest_change(scene, cloud, bent, Quantity::stress), 1e-4 * young);
  EXPECT_GT(largest_change(scene, cloud, bent, Quantity::strain), 1e-4);
  scene.bodies[0].material.viscosity = 1e-3;
  EXPECT_GT(largest_change(scene, cloud, bent, Quantity::stress), 1e-4 * young);
  EXPECT_GT(largest_change(scene, cloud, bent, Quantity::strain), 1e-4);
  scene.bodies[0].material.viscosity = 0;
  Selection layer;
  layer.box = Selection::Box{{0.3, -1, -1}, {0.4, 1, 1}};
  scene.bodies[0].inclusions = {{.select = layer, .material = scene.bodies[0].material}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  const Recovery recovery(model);
  ASSERT_EQ(model.parts.size(), 2u);
  for (Index i = model.parts[1].begin; i < model.parts[1].end; ++i) {
    EXPECT_EQ(recovery.share(i), 0);
  }
}

/// A metal below its yield stress has the stress of Hencky's law, on the surface, too.
TEST(Recovery, ServesMetals) {
  Material metal = testing::j2::perfect;
  metal.density = 1;
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.4, 0.5}), {.phyxels = 1000});
  Quadratic bent;
  bent.curvature[0] = {0, 0, 1e-3, 0, 0, 0};  // u_x = x z 1e-3: ε_xx grows with z
  const Model model = build_model(one_body(metal), std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  State state = state_of(displaced(model, bent));
  state.history = virgin_history(model);
  backend->upload(state);
  const Recovery recovery(model);
  const Quantity wanted[] = {Quantity::stress};
  const std::vector<double> own = find_fields(model, *backend, wanted).at(Quantity::stress),
                            better = find_fields(model, *backend, wanted, &recovery)
                                         .at(Quantity::stress);
  double before = 0, after = 0;
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d x = model.position[i];
    const bool inside = x.x > 0.2 && x.x < 0.8 && x.y > 0.1 && x.y < 0.3;
    if (!inside || (x.z > 1e-6 && x.z < 0.5 - 1e-6)) continue;
    // Plane strain across and along: σ_xx = E (1 - ν) ε/((1 + ν)(1 - 2ν)).
    const double right = metal.young * 0.65 / (1.35 * 0.3) * 1e-3 * x.z;
    before = std::max(before, std::abs(own[6 * i] - right));
    after = std::max(after, std::abs(better[6 * i] - right));
    // The traction is that of the own stress, but for the normal's tilt of up to 0.2.
    EXPECT_NEAR(better[6 * i + 2], own[6 * i + 2], 0.1 * before);
  }
  EXPECT_LT(after, 0.4 * before);  // seen: 0.31
}

/// On each face the normal points outward, and the traction is that of the phyxel's own stress; the
/// stress along the face is that of the displacement: here a bar whose shear strain is linear in
/// depth.
TEST(Recovery, KeepsTractions) {
  Material material = rubber();
  material.law = "small-strain";
  const Scene scene = one_body(material);
  const Cloud cloud = sample_surface(test::box({0, 0, 0}, {1, 0.4, 0.5}), {.phyxels = 1000});
  const Model model = build_model(scene, std::span(&cloud, 1));
  Quadratic bent;
  bent.curvature[0] = {0, 0, 1e-2, 0, 0, 0};  // u_x = x z 1e-2: ε_xx grows with z
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(displaced(model, bent)));
  const Recovery recovery(model);
  const Quantity wanted[] = {Quantity::stress, Quantity::strain};
  const FieldValues own = find_fields(model, *backend, wanted),
                    better = find_fields(model, *backend, wanted, &recovery);
  Index on_top = 0;
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d x = model.position[i];
    const bool inside = x.x > 0.2 && x.x < 0.8 && x.y > 0.15 && x.y < 0.25;
    if (!inside || x.z < 0.5 - 1e-6) continue;
    ++on_top;
    EXPECT_GT(recovery.normal(i).z, 0.98);
    EXPECT_EQ(recovery.share(i), 1);
    const auto at = [&](const FieldValues& fields, Quantity q, int k) {
      return fields.at(q)[6 * i + k];
    };
    // Traction along z, but for the normal's tilt of up to 0.2.
    EXPECT_NEAR(at(better, Quantity::stress, 2), at(own, Quantity::stress, 2),
                0.1 * material.young * 5e-3);
    const double right = 1e-2 * 0.5, error = std::abs(at(better, Quantity::strain, 0) - right);
    EXPECT_LT(error, 0.05 * right);
    EXPECT_GT(std::abs(at(own, Quantity::strain, 0) - right), 2 * error);
  }
  EXPECT_GT(on_top, 5);
}

/// A cube under its own weight, on a smooth floor: σ_zz = -ρ g (1 - z) throughout. Recovered stress
/// is as good as that which the balance of forces determines.
TEST(Recovery, LeavesWhatEquilibriumDetermines) {
  const Cloud cloud = sample_surface(test::unit_cube(), {.phyxels = 1000});
  Material material = rubber();
  material.law = "small-strain";
  material.poisson = 0;
  Scene scene = one_body(material);
  scene.gravity = {0, 0, -10};
  Selection floor;
  floor.box = Selection::Box{{-1, -1, -1}, {2, 2, 0}};
  scene.bodies[0].fixed = {{.select = floor}};
  scene.solver.method = Method::equilibrium;
  const Model model = build_model(scene, std::span(&cloud, 1));
  const auto backend = make_test_backend(model, Precision::double_);
  find_equilibrium(model, *backend);
  const Recovery recovery(model);
  const double largest = material.density * 10;
  const auto error = [&](const Recovery* by) {
    const Quantity wanted[] = {Quantity::stress};
    const std::vector<double> stress = find_fields(model, *backend, wanted, by).at(wanted[0]);
    double squares = 0;
    for (Index i = 0; i < model.size(); ++i) {
      squares += std::pow(stress[6 * i + 2] / largest + 1 - model.position[i].z, 2);
    }
    return std::sqrt(squares / model.size());
  };
  EXPECT_LT(error(&recovery), 1.1 * error(nullptr));
}

}  // namespace
}  // namespace phyxel
