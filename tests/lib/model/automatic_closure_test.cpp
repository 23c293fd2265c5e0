/// Closed gradients of scenes that do not ask for them: which bodies get them, and what for.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "phyxel/body_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/shapes.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/folder.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

ShapeRequest block(double jitter) {
  return {.name = "block",
          .size = {0.8, 0.6, 1.0},
          .spacing = 0.1,
          .jitter = jitter,
          .placement = ShapeRequest::Placement::nodes};
}

/// The tolerance that a body of this cloud gets.
/// @param warnings that the model has to have
double closure_of(const Cloud& cloud, const NeighbourhoodRule& rule = {},
                  VolumeRule volumes = VolumeRule::automatic, std::size_t warnings = 0) {
  Scene scene = one_body(rubber(), rule);
  scene.bodies[0].volume_rule = volumes;
  const Model model = build_model(scene, std::span(&cloud, 1));
  EXPECT_EQ(model.closing.empty(), model.parts[0].closure == 0);
  EXPECT_EQ(model.warnings.size(), warnings);
  return model.parts[0].closure;
}

TEST(AutomaticClosure, IsForIrregularBodiesWithAClosedSurface) {
  const Cloud irregular = make_shape(block(0.2));
  EXPECT_EQ(closure_of(irregular), automatic_closure);
  EXPECT_EQ(closure_of(sample_surface(test::unit_cube(), {.phyxels = 600})), automatic_closure);
  EXPECT_EQ(closure_of(make_shape(block(0))), 0);
  Cloud bare = irregular;
  bare.surface = {};
  EXPECT_EQ(closure_of(bare), 0);
  Cloud open = irregular;
  open.surface.groups.clear();
  open.surface.triangle.pop_back();
  EXPECT_EQ(closure_of(open, {}, VolumeRule::automatic, 1), 0);
  NeighbourhoodRule adaptive;
  adaptive.support = NeighbourhoodRule::Support::adaptive;
  EXPECT_EQ(closure_of(irregular, adaptive), 0);
  EXPECT_EQ(closure_of(irregular, {}, VolumeRule::kernel), 0);
  // The bodies of the paper, on lattices, stay as they were published.
  EXPECT_EQ(closure_of(make_shape({.name = "dino"})), 0);
}

using AutomaticClosureFiles = test::Folder;
TEST_F(AutomaticClosureFiles, FilesTellLattices) {
  for (const double jitter : {0.0, 0.2}) {
    const std::filesystem::path file = folder_ / fmt::format("{}.h5", jitter);
    write_body(file, make_shape(block(jitter)), false);
    EXPECT_EQ(read_body(file).lattice, jitter == 0);
    EXPECT_EQ(closure_of(read_body(file)), jitter == 0 ? 0 : automatic_closure);
  }
}

/// Forces that a uniform stress leaves inside, by those that it needs on the surface.
double forces_inside(const Model& model) {
  std::vector<Vec3d> u;
  for (const Vec3d& x : model.position) u.push_back({1e-3 * x.x, 0, 0});
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(u));
  std::vector<Vec3d> force;
  backend->internal_forces(force);
  double inside = 0, on_surface = 0;
  for (std::size_t i = 0; i < force.size(); ++i) {
    const Vec3d p = model.position[i];
    const double depth = std::min({p.x, p.y, p.z, 1 - p.x, 1 - p.y, 1 - p.z});
    (depth > 0 ? inside : on_surface) += dot(force[i], force[i]);
  }
  return std::sqrt(inside / on_surface);
}

TEST(AutomaticClosure, LetsAUniformStressRest) {
  const Cloud cloud = sample_surface(test::unit_cube(), {.phyxels = 1500});
  Scene scene = one_body(rubber());
  const double by_default = forces_inside(build_model(scene, std::span(&cloud, 1)));
  scene.bodies[0].closure = 0;
  const double plain = forces_inside(build_model(scene, std::span(&cloud, 1)));
  // The tolerance is relative to all areas of the surface; the square of a tenth stays far below.
  EXPECT_LT(by_default, 3 * automatic_closure);
  EXPECT_GT(plain, 0.1);
}

/// A round bar of flat facets, few of which have phyxels of their own, but many one or two in their
/// planes by chance.
TEST(AutomaticClosure, LeavesTheStepOfFacetedBodiesNearlyAsLong) {
  Surface prism;
  constexpr Index sides = 48;
  for (Index k = 0; k < sides; ++k) {
    const double angle = 2 * std::numbers::pi * k / sides;
    for (const double z : {0.0, 3.0}) {
      prism.position.push_back({std::cos(angle), std::sin(angle), z});
    }
  }
  prism.position.push_back({0, 0, 0});
  prism.position.push_back({0, 0, 3});
  for (Index k = 0; k < sides; ++k) {
    const Index low = 2 * k, next = 2 * ((k + 1) % sides);
    prism.triangle.push_back({low, next, low + 1});
    prism.triangle.push_back({next, next + 1, low + 1});
    prism.triangle.push_back({2 * sides, next, low});
    prism.triangle.push_back({2 * sides + 1, low + 1, next + 1});
  }
  test::add_normals(prism);
  const Cloud cloud = sample_surface(prism, {.phyxels = 2000});
  Scene scene = one_body(rubber());
  const auto step = [&] {
    return step_limit(build_model(scene, std::span(&cloud, 1)), 1).largest_step;
  };
  const double closed = step();
  scene.bodies[0].closure = 0;
  // 0.75 here; 0.13 if areas are shared out among phyxels that are nearly in a line.
  EXPECT_GT(closed, 0.6 * step());
}

TEST(AutomaticClosure, IsNotForBodiesOfFewPhyxels) {
  const Surface cube = test::unit_cube();
  for (const Index n : {2, 3}) {
    SCOPED_TRACE(n);
    EXPECT_EQ(closure_of(sample_surface(cube, {.phyxels = n}), {}, VolumeRule::automatic, 2), 0);
  }
}

/// Of two bodies, one of which would have to change volumes too far.
TEST(AutomaticClosure, LeavesABodyOpenThatCannotBeClosed) {
  Scene scene = one_body(rubber());
  scene.bodies.push_back(scene.bodies[0]);
  std::vector<Cloud> clouds = {make_shape(block(0.2)),
                               sample_surface(test::unit_cube(), {.phyxels = 400})};
  // A phyxel of the second body far out of its cell.
  clouds[1].volume[7] *= 30;
  const Model model = build_model(scene, clouds);
  EXPECT_EQ(model.parts[0].closure, automatic_closure);
  EXPECT_EQ(model.parts[1].closure, 0);
  EXPECT_THAT(model.warnings,
              ::testing::ElementsAre(HasSubstr("gradients are not closed, as phyxel")));
  scene.bodies[0].closure = automatic_closure;
  scene.bodies[1].closure = 0;
  const Model asked = build_model(scene, clouds);
  EXPECT_EQ(model.closing, asked.closing);
  EXPECT_EQ(model.volume, asked.volume);
  EXPECT_EQ(model.parts[1].volume, asked.parts[1].volume);
  scene.bodies[1].closure = automatic_closure;
  EXPECT_THROW(build_model(scene, clouds), InputError);
}

}  // namespace
}  // namespace phyxel
