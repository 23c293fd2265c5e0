/// Selections by closed meshes: cores of another material, and parts that are held.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "model/selection.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/model.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/folder.hpp"
#include "support/mesh_content.hpp"
#include "support/refusal.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

class MeshSelection : public test::Folder {
 protected:
  /// The numbers of the phyxels of a cloud of points that a mesh selects.
  std::vector<Index> selected(const Surface& mesh, const std::vector<Vec3d>& position,
                              const BodyRequest& placement = {}) {
    const Cloud cloud{.position = position};
    const Selection selection{.mesh = write("selection.stl", test::binary_stl(mesh))};
    return select(selection, {cloud, {}, static_cast<Index>(position.size())}, placement);
  }
};

TEST_F(MeshSelection, HasWhatIsInsideAndOnTheSurface) {
  const std::vector<Vec3d> points = {{0.5, 0.5, 0.5}, {0, 0.5, 0.5},     {0, 0, 0.5},
                                     {1, 1, 1},       {-1e-3, 0.5, 0.5}, {1.001, 1.001, 1.001},
                                     {5, 5, 5}};
  EXPECT_THAT(selected(test::unit_cube(), points), ::testing::ElementsAre(0, 1, 2, 3));
  // Inside out, and two that overlap.
  EXPECT_THAT(selected(test::turned(test::unit_cube()), points),
              ::testing::ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(
      selected(test::together(test::unit_cube(), test::box({0.2, 0.2, 0.2}, {6, 6, 6})), points),
      ::testing::ElementsAre(0, 1, 2, 3, 5, 6));
}

TEST_F(MeshSelection, IsPlacedAsTheBodyIs) {
  BodyRequest placement;
  placement.scale = 2;
  placement.rotation = {0, 0, 90};
  placement.translation = {10, 0, 0};
  // The unit cube becomes [8, 10] x [0, 2] x [0, 2].
  EXPECT_THAT(selected(test::unit_cube(),
                       {{9, 1, 1}, {8.1, 1.9, 0.1}, {0.5, 0.5, 0.5}, {10.1, 1, 1}}, placement),
              ::testing::ElementsAre(0, 1));
}

/// A ball with a stiff core under pressure from outside. Lame's solution: u = A r in the core and
/// B r + C / r² around it, with radial stresses 3 K A and 3 K B - 4 G C / r³ that meet at the
/// interface.
TEST_F(MeshSelection, ACoreOfAnotherMaterialActsAsLamesSolutionHasIt) {
  const double core = 0.6, young = 1e5, stiff = 10, nu = 0.3, pressure = 100;
  const double k = young / (3 * (1 - 2 * nu)), g = young / (2 * (1 + nu)), k_core = stiff * k;
  // Continuity at the interface: A = B + C / a³ and k_core A = k B - 4/3 g C / a³.
  const double a3 = core * core * core;
  const double c_by_b = a3 * (k - k_core) / (k_core + 4.0 / 3 * g);
  const double b = -pressure / (3 * k - 4 * g * c_by_b);
  const double outer = b * (1 + c_by_b), inner = b * (1 + c_by_b / a3);

  Material material = rubber();
  material.law = "small-strain";
  material.hourglass = 0.1;
  Scene scene = one_body(material);
  BodyRequest& body = scene.bodies[0];
  body.source.mesh = write("ball.stl", test::binary_stl(test::sphere({0, 0, 0}, 1, 4)));
  body.source.phyxels = 8000;
  Material of_core = material;
  of_core.young = stiff * young;
  body.inclusions.push_back(
      {{.mesh = write("core.stl", test::binary_stl(test::sphere({0, 0, 0}, core, 4)))}, of_core});
  body.fixed.push_back({.select = {.ball = Selection::Ball{{0, 0, 0}, 0.1}}});
  body.tractions.push_back({.select = {.all = true}, .pressure = pressure});
  const Model model = build_model(scene);
  ASSERT_EQ(model.parts.size(), 2u);
  EXPECT_NEAR(model.parts[1].volume / (model.parts[0].volume + model.parts[1].volume), a3,
              0.02 * a3);
  const auto backend = make_test_backend(model, Precision::double_);
  const State rest = find_equilibrium(model, *backend).state;
  double at_surface = 0, at_core = 0;
  int on_surface = 0, on_core = 0;
  for (Index i = 0; i < model.size(); ++i) {
    const double r = norm(model.position[i]);
    const double moved = dot(rest.displacement[i], model.position[i]) / r;
    if (r > 0.99) at_surface += moved, ++on_surface;
    if (r > 0.3 && r < 0.45) at_core += moved / r, ++on_core;
  }
  // The interface is as rough as phyxels are far apart, 0.08. Without the core the surface would
  // move 1.5 times as far, and the inside seven times.
  EXPECT_NEAR(at_surface / on_surface / outer, 1, 0.03);
  EXPECT_NEAR(at_core / on_core / inner, 1, 0.05);
}

TEST_F(MeshSelection, RefusesMeshesThatEncloseNothing) {
  const auto refusal = [&](const Surface& mesh) {
    return refusal_of([&] { selected(mesh, {{0.5, 0.5, 0.5}}); });
  };
  EXPECT_THAT(refusal(test::without(test::unit_cube(), 3)),
              HasSubstr("selection.stl: the surface is not closed (1 part, 3 open edges"));
  EXPECT_THAT(refusal_of([&] {
                select({.mesh = folder_ / "none.obj"}, {Cloud{}, {}, 0}, BodyRequest{});
              }),
              HasSubstr("none.obj"));
}

}  // namespace
}  // namespace phyxel
