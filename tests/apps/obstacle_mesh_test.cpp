/// Meshes of obstacles, as exports have them.
#include "export/obstacle_mesh.hpp"

#include <gtest/gtest.h>

#include "model/contact.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "phyxel/physics/rigid.hpp"
#include "scene/parse_obstacles.hpp"

namespace phyxel {
namespace {

/// Meshes of all shapes lie on the shapes, face outward, and enclose their volume.
TEST(ObstacleMeshes, AreTheSurfacesOfTheirShapes) {
  const std::string lengths[] = {"shape = \"plane\"", "shape = \"sphere\"\nradius = 2",
                                 "shape = \"box\"\nsize = [1, 2, 3]",
                                 "shape = \"cylinder\"\nradius = 1\nlength = 3",
                                 "shape = \"capsule\"\nradius = 1\nlength = 3"};
  for (const std::string& shape : lengths) {
    for (const bool hollow : {false, true}) {
      const std::string text = "[[body]]\nmesh = \"gone.obj\"\n[[obstacle]]\n" + shape +
                               (hollow ? "\nhollow = true\n" : "\n");
      const Obstacle obstacle = obstacles_of(parse_obstacles(text, "scene.toml")).at(0);
      const Surface mesh = app::obstacle_mesh(obstacle, {5, 6, 7}, 10);
      SCOPED_TRACE(text);
      ASSERT_FALSE(mesh.triangle.empty());
      ObstacleShapes::with(obstacle.form, [&]<class Shape>(const Shape& exact) {
        for (std::size_t k = 0; k < mesh.position.size(); ++k) {
          EXPECT_NEAR(exact.gap(mesh.position[k]).distance, 0, 1e-12);
        }
        for (const Triangle& triangle : mesh.triangle) {
          const auto at = [&](int c) { return static_cast<std::size_t>(triangle[c]); };
          const Vec3d a = mesh.position[at(0)], b = mesh.position[at(1)], c = mesh.position[at(2)];
          const Vec3d out = (hollow ? -1.0 : 1.0) * exact.gap((a + b + c) / 3.0).normal;
          EXPECT_GT(dot(normalised(cross(b - a, c - a)), out), 0.995);
          for (int k = 0; k < 3; ++k) EXPECT_GT(dot(mesh.normal[at(k)], out), 0.995);
        }
        if constexpr (requires { exact.solid(); }) {
          const double volume = exact.solid().volume;
          EXPECT_NEAR(enclosed_volume(mesh) * (hollow ? -1 : 1) / volume, 1, 0.005);
        } else {
          const Vec3d middle =
              0.25 * (mesh.position[0] + mesh.position[1] + mesh.position[2] + mesh.position[3]);
          EXPECT_LT(norm(middle - Vec3d{5, 6, 0}), 1e-12);  // opposite the bodies
        }
      });
    }
  }
}

}  // namespace
}  // namespace phyxel
