/// Surfaces of shapes that are filled as meshes are, and what acts on them.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "model/assembly.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/shapes.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
constexpr double pi = std::numbers::pi;

ShapeRequest fitted(const std::string& name, Index phyxels) {
  ShapeRequest shape{
      .name = name, .radius = 1, .length = 3, .placement = ShapeRequest::Placement::fitted};
  shape.spacing = spacing_for(shape, phyxels);
  return shape;
}

/// Surfels lie on the solid's surface, about one for each square of the spacing: on coarse bodies
/// more, such that their triangles miss little of its volume.
TEST(FittedShapes, HaveFewSurfelsAllOnTheirSurface) {
  for (const std::string name : {"sphere", "cylinder"}) {
    for (const Index phyxels : {500, 20000}) {
      const ShapeRequest shape = fitted(name, phyxels);
      const Surface surface = make_shape(shape).surface;
      const bool is_sphere = name == "sphere";
      for (const Vec3d p : surface.position) {
        const double on_side = is_sphere ? norm(p) - 1 : std::hypot(p.x, p.y) - 1;
        EXPECT_LT(on_side, 1e-14);
        EXPECT_TRUE(on_side > -1e-14 || (!is_sphere && std::abs(p.z) == 1.5)) << p.z;
      }
      const double volume = pi * (is_sphere ? 4.0 / 3 : 3), area = pi * (is_sphere ? 4 : 8);
      // A polygon of 96 corners has 0.07% less area than its circle; facets with edges e cut off
      // 3/8 e² of a sphere of radius 1, here at most 1.4 times 2 π / 96.
      EXPECT_NEAR(enclosed_volume(surface) / volume, 1, is_sphere ? 0.0032 : 0.0008);
      const double between = std::min(shape.spacing, 2 * pi / 96);
      const auto surfels = static_cast<double>(surface.position.size());
      EXPECT_LT(surfels * between * between, 1.5 * area);
      EXPECT_GT(surfels * shape.spacing * shape.spacing, 0.7 * area);
    }
  }
}

/// The total of a traction of 1 Pa along x on a part of a fitted shape's surface [N].
double total_on(const ShapeRequest& shape, const Selection& select) {
  Scene scene = one_body();
  scene.bodies[0].source.shape = shape;
  scene.bodies[0].tractions = {{.select = select, .traction = {1, 0, 0}}};
  return build_model(scene).loads[0].total.x;
}

/// A region of the solid's own size holds all of its surface, and half of it a half.
TEST(FittedShapes, TakeTractionsInRegionsOfTheirSize) {
  Selection all, ball, tight, upper;
  all.all = true;
  ball.ball = Selection::Ball{{0, 0, 0}, 1};
  tight.box = Selection::Box{{-1, -1, -1.5}, {1, 1, 1.5}};
  upper.box = Selection::Box{{-1, -1, 0}, {1, 1, 1.5}};
  for (const Index phyxels : {50, 800}) {
    const ShapeRequest sphere = fitted("sphere", phyxels), rod = fitted("cylinder", phyxels);
    const double of_sphere = total_on(sphere, all), of_rod = total_on(rod, all);
    EXPECT_NEAR(of_sphere / (4 * pi), 1, 0.005);
    EXPECT_NEAR(of_rod / (8 * pi), 1, 0.002);
    EXPECT_NEAR(total_on(sphere, ball), of_sphere, 1e-9);
    EXPECT_NEAR(total_on(rod, tight), of_rod, 1e-9);
    EXPECT_NEAR(total_on(sphere, upper), of_sphere / 2, 1e-6);
    EXPECT_NEAR(total_on(rod, upper), of_rod / 2, 1e-6);
  }
}

}  // namespace
}  // namespace phyxel
