/// Fields of frames on the surface.
#include "phyxel/output_fields.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/equilibrium.hpp"
#include "phyxel/history.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/state.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::ElementsAre;

OutputRequest output_of(std::vector<std::string> fields) {
  OutputRequest output;
  output.fields = std::move(fields);
  return output;
}
const Cloud& ball(Index phyxels = 1500) {
  static const Cloud cloud =
      sample_surface(test::sphere({0, 0, 0}, 0.5, 4), {.phyxels = phyxels, .relaxations = 10});
  return cloud;
}

/// The fields of a model whose phyxels are displaced by u(x).
template <class U>
FieldValues fields_of(const Model& model, const OutputRequest& output, U&& u) {
  const auto backend = make_test_backend(model, Precision::double_);
  std::vector<Vec3d> displacement;
  for (const Vec3d x : model.position) displacement.push_back(u(x));
  State state = state_of(displacement);
  state.history = virgin_history(model);
  backend->upload(state);
  SurfelState surfels;
  backend->advect_surfels(surfels);
  const auto recovery = recovery_for(output, model);
  return OutputFields(model, output).find(*backend, state, &surfels, recovery.get());
}

TEST(OutputFields, OfSurfelsAreThoseThatTheOutputNames) {
  const Model model = build_model(one_body(), std::span(&ball(), 1));
  const OutputFields fields(model, output_of({"velocity", "von_mises", "boundary", "mass"}));
  EXPECT_THAT(fields.quantities(),
              ElementsAre(Quantity::von_mises, Quantity::boundary, on_surface(Quantity::velocity),
                          on_surface(Quantity::von_mises), on_surface(Quantity::boundary)));
  OutputRequest no_surface = output_of({"displacement", "von_mises"});
  EXPECT_THAT(OutputFields(model, no_surface).quantities(),
              ElementsAre(Quantity::von_mises, on_surface(Quantity::displacement),
                          on_surface(Quantity::von_mises)));
  no_surface.surface = false;
  EXPECT_THAT(OutputFields(model, no_surface).quantities(), ElementsAre(Quantity::von_mises));
}

/// Under a uniform deformation all surfels have the tensors of all phyxels, and a stress is
/// computed for the values that follow from it.
TEST(OutputFields, OfSurfelsFollowAUniformDeformation) {
  const Model model = build_model(one_body(), std::span(&ball(), 1));
  const auto stretched = [](Vec3d x) { return Vec3d{0.1 * x.x + 0.02 * x.y, 0.05 * x.z, 0}; };
  const FieldValues found = fields_of(
      model, output_of({"displacement", "strain", "von_mises", "principal_stress", "volume_ratio"}),
      stretched);
  EXPECT_EQ(found.count(Quantity::stress), 0u);
  const std::size_t surfels = model.surfels.position.size();
  ASSERT_GT(surfels, 1000u);
  for (const Quantity q : {Quantity::strain, Quantity::von_mises, Quantity::principal_stress,
                           Quantity::volume_ratio}) {
    const std::size_t width = width_of(q);
    const std::vector<double>& here = found.at(on_surface(q));
    ASSERT_EQ(here.size(), width * surfels);
    for (std::size_t k = 0; k < here.size(); ++k) {
      const double right = found.at(q)[k % width];
      EXPECT_NEAR(here[k], right, 1e-9 * std::max(1.0, std::abs(right)));
    }
  }
  const std::vector<double>& way = found.at(on_surface(Quantity::displacement));
  for (std::size_t s = 0; s < surfels; ++s) {
    EXPECT_LE(norm(Vec3d{way[3 * s], way[3 * s + 1], way[3 * s + 2]} -
                   stretched(model.surfels.position[s])),
              1e-12);
  }
}

/// Surfels of a body that turns and stretches move as their places do. Their velocities are within
/// the range of those around them, which cuts off half a spacing of the ball at its poles.
TEST(OutputFields, OfSurfelsHaveVelocitiesOfTheirPlaces) {
  const Model model = build_model(one_body(), std::span(&ball(), 1));
  const auto velocity_at = [](Vec3d x) { return Vec3d{-2 * x.y, 2 * x.x, 1 + x.z}; };
  const auto backend = make_test_backend(model, Precision::double_);
  State state = state_of(std::vector<Vec3d>(model.position.size()));
  for (Index i = 0; i < model.size(); ++i) state.velocity[i] = velocity_at(model.position[i]);
  backend->upload(state);
  SurfelState surfels;
  backend->advect_surfels(surfels);
  const FieldValues found =
      OutputFields(model, output_of({"velocity"})).find(*backend, state, &surfels, nullptr);
  const std::vector<double>& velocity = found.at(on_surface(Quantity::velocity));
  ASSERT_EQ(velocity.size(), 3 * model.surfels.position.size());
  for (std::size_t s = 0; s < model.surfels.position.size(); ++s) {
    const Vec3d right = velocity_at(model.surfels.position[s]);
    const Vec3d here{velocity[3 * s], velocity[3 * s + 1], velocity[3 * s + 2]};
    EXPECT_LT(norm(here - right), 0.02);
  }
}

/// The strain of a quadratic displacement along the surface of a ball, linear in space: within 1%
/// of its largest value; without recovery, 4% off.
TEST(OutputFields, OfSurfelsAreOfSecondOrder) {
  Material material = rubber();
  material.law = "small-strain";
  const Model model = build_model(one_body(material), std::span(&ball(), 1));
  const auto bent = [](Vec3d x) { return Vec3d{1e-4 * x.x * x.z, 0, -0.5e-4 * x.x * x.x}; };
  const auto largest_error = [&](bool recovers) {
    OutputRequest output = output_of({"strain"});
    output.recovery = recovers;
    const FieldValues found = fields_of(model, output, bent);
    double largest = 0;
    for (std::size_t s = 0; s < model.surfels.position.size(); ++s) {
      if (std::abs(model.surfels.position[s].x) > 0.1) continue;
      const double error =
          found.at(on_surface(Quantity::strain))[6 * s] - 1e-4 * model.surfels.position[s].z;
      largest = std::max(largest, std::abs(error));
    }
    return largest / 0.5e-4;
  };
  EXPECT_LT(largest_error(true), 0.01);
  EXPECT_GT(largest_error(false), 0.03);
}

/// Stresses jump where the material does: a surfel has that of the material beneath it.
TEST(OutputFields, OfSurfelsDoNotMixMaterials) {
  Material soft = rubber(), stiff = soft;
  soft.law = stiff.law = "small-strain";
  stiff.young *= 1000;
  Scene scene = one_body(soft);
  Selection half;
  half.box = Selection::Box{{0, -1, -1}, {1, 1, 1}};
  scene.bodies[0].inclusions = {{.select = half, .material = stiff}};
  const Model model = build_model(scene, std::span(&ball(), 1));
  const FieldValues found = fields_of(model, output_of({"stress"}), [](Vec3d x) {
    return Vec3d{1e-6 * x.x, 0, 0};
  });
  const double modulus =
      soft.young * (1 - soft.poisson) / (1 + soft.poisson) / (1 - 2 * soft.poisson);
  int of_soft = 0, of_stiff = 0;
  for (std::size_t s = 0; s < model.surfels.position.size(); ++s) {
    const double share = found.at(on_surface(Quantity::stress))[6 * s] / (1e-6 * modulus);
    // Strains of a fit are second order in the displacement's gradient.
    of_soft += std::abs(share - 1) < 1e-4;
    of_stiff += std::abs(share / 1000 - 1) < 1e-4;
  }
  EXPECT_EQ(of_soft + of_stiff, static_cast<int>(model.surfels.position.size()));
  EXPECT_GT(std::min(of_soft, of_stiff), 500);
}

/// What a material remembers is nowhere beyond what phyxels around have.
TEST(OutputFields, OfSurfelsHoldWhatMaterialsRemember) {
  Scene scene = one_body();
  scene.bodies[0].material.viscosity = 1e-3;
  const Model model = build_model(scene, std::span(&ball(), 1));
  const std::vector<std::string> columns = history_columns(model);
  ASSERT_FALSE(columns.empty());
  const auto backend = make_test_backend(model, Precision::double_);
  State state = state_of(std::vector<Vec3d>(model.position.size()));
  state.history = virgin_history(model);
  for (Index i = 0; i < model.size(); ++i) {
    state.history[0].values[i] = 1 + model.position[i].z;
  }
  backend->upload(state);
  SurfelState surfels;
  backend->advect_surfels(surfels);
  const OutputRequest output = output_of({"history"});
  const FieldValues found = OutputFields(model, output).find(*backend, state, &surfels, nullptr);
  const std::vector<double>& here = found.at(on_surface(history_quantity(0)));
  for (std::size_t s = 0; s < here.size(); ++s) {
    // The highest phyxel may be half a spacing below a surfel at the pole.
    EXPECT_NEAR(here[s], 1 + model.surfels.position[s].z, 0.01);
    EXPECT_LE(here[s], 1.5);
  }
}

/// The surface of a lattice of cells is half a spacing above its phyxels: a linear strain goes on.
TEST(OutputFields, OfSurfelsGoOnAboveLatticesOfCells) {
  Material material = rubber();
  material.law = "small-strain";
  Scene scene = one_body(material);
  scene.bodies[0].source.shape = {.name = "beam",
                                  .size = {1, 0.4, 0.5},
                                  .spacing = 0.05,
                                  .placement = ShapeRequest::Placement::cells};
  const Model model = build_model(scene);
  const FieldValues found = fields_of(model, output_of({"strain", "von_mises"}), [](Vec3d x) {
    return Vec3d{1e-4 * x.x * x.z, 0, -0.5e-4 * x.x * x.x};
  });
  const std::vector<double>& strain = found.at(on_surface(Quantity::strain));
  int above = 0;
  for (std::size_t s = 0; s < model.surfels.position.size(); ++s) {
    const Vec3d x = model.surfels.position[s];
    if (std::abs(x.x - 0.5) > 0.3 || std::abs(std::abs(x.z) - 0.25) > 1e-9) continue;
    ++above;
    EXPECT_NEAR(strain[6 * s], 1e-4 * x.z, 0.01 * 1e-4 * 0.25);
  }
  EXPECT_GT(above, 20);
}

}  // namespace
}  // namespace phyxel
