/// Obstacles that are surfaces from files, beside shapes for which there are formulas.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/contact_scene.hpp"
#include "support/folder.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

/// Obstacles whose surfaces are written to files.
class MeshObstacles : public test::Folder {
 protected:
  /// An obstacle whose mesh is a surface.
  std::string mesh(const Surface& surface, const std::string& more) const {
    std::string text;
    for (const Vec3d x : surface.position) {
      text += fmt::format("v {:.17g} {:.17g} {:.17g}\n", x.x, x.y, x.z);
    }
    for (const Triangle& t : surface.triangle) {
      text += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
    return obstacle(
        fmt::format("shape = 'mesh'\nmesh = '{}'\n{}", write("mesh.obj", text).string(), more));
  }
};

/// A block that is dropped, spinning, on what lies under it.
std::string dropped(const std::string& under) {
  return "gravity = [0, 0, -9.81]\n" + end + under +
         block("spin = [1, 2, 3]\nvelocity = [0.5, 0, -1]\ntranslation = [0, 0, 0.15]\n");
}

TEST_F(MeshObstacles, WithFlatFacesActAsBoxes) {
  const std::string more = "friction = 0.3\nrestitution = 0.2\ntranslation = [0, 0, -0.3]\n";
  Way box(dropped(obstacle("shape = 'box'\nsize = [2, 2, 0.6]\n" + more)), dt);
  Way same(dropped(mesh(test::box({-0.5, -0.5, -0.15}, {0.5, 0.5, 0.15}), "scale = 2\n" + more)),
           dt);
  box.solver.step(600);
  same.solver.step(600);
  EXPECT_GT(box.contacts()[0].impulse.z, 10);
  // Distances are kept as floats: 1e-8 of a width of 0.3 m, which collisions enlarge.
  EXPECT_LE(norm(box.contacts()[0].impulse - same.contacts()[0].impulse), 1e-4);
  EXPECT_LE(norm(box.centre() - same.centre()), 1e-6);
  EXPECT_LE(norm(box.momentum() - same.momentum()), 1e-4);
}

TEST_F(MeshObstacles, OfOneSurfaceShareItsDistances) {
  const Surface cube = test::box({-0.5, -0.5, -0.15}, {0.5, 0.5, 0.15});
  const Scene scene =
      parse_scene(dropped(mesh(cube, "translation = [0, 0, -0.3]\n") +
                          mesh(cube, "rotation = [0, 0, 30]\ntranslation = [0, 0, -1.3]\n") +
                          mesh(cube, "scale = 1.5\ntranslation = [0, 0, -2.3]\n")),
                  "scene.toml");
  const Model model = build_model(scene);
  EXPECT_EQ(model.obstacles[1].distances, model.obstacles[0].distances);
  EXPECT_EQ(model.obstacles[1].surface, model.obstacles[0].surface);
  EXPECT_EQ(model.obstacles[1].form.field.fine, model.obstacles[0].form.field.fine);
  EXPECT_NE(model.obstacles[2].distances, model.obstacles[0].distances);
}

TEST_F(MeshObstacles, ThatAreRoundActAsSpheres) {
  const std::string more =
      "friction = 0.3\ntranslation = [0.02, 0, -0.4]\n[obstacle.motion]\nvelocity = [0, 0.3, 0]\n"
      "rotation = [0, 90, 0]\nduration = 1\nabout = [0.02, 0, -0.4]\n";
  Way sphere(dropped(obstacle("shape = 'sphere'\nradius = 0.4\n" + more)), dt);
  Way same(dropped(mesh(test::sphere({}, 0.4, 5), more)), dt);
  for (Way* way : {&sphere, &same}) way->solver.step(400);
  const double impulse = norm(sphere.contacts()[0].impulse);
  EXPECT_GT(impulse, 10);
  // The grid of distances, 0.026 m wide, is h²/(4 R) = 4e-4 m off, a thirtieth of what the block
  // has fallen in.
  EXPECT_LE(norm(sphere.contacts()[0].impulse - same.contacts()[0].impulse), 0.03 * impulse);
  EXPECT_LE(norm(sphere.centre() - same.centre()), 2e-3);
}

TEST_F(MeshObstacles, MakeAllChangesOfMomentum) {
  Way way(dropped(mesh(test::sphere({}, 0.4, 3), "friction = 0.3\ntranslation = [0, 0, -0.4]\n")),
          dt);
  const Vec3d before = way.momentum();
  way.solver.step(500);
  const Vec3d weight = way.mass() * way.model.gravity;
  const Vec3d change = way.momentum() - before - 500 * dt * weight;
  EXPECT_GT(norm(change), 10);
  EXPECT_LE(norm(change - way.contacts()[0].impulse), 1e-12 * norm(change));
}

TEST_F(MeshObstacles, HoldBodiesInside) {
  Way way("gravity = [0, 0, -9.81]\n" + end +
              mesh(test::box({-0.3, -0.3, -0.2}, {0.3, 0.3, 0.4}), "hollow = true\n") +
              block("velocity = [1, 0.5, 0]\n"),
          dt);
  way.solver.step(2000);
  const Vec3d at = way.centre();
  EXPECT_LT(std::abs(at.x), 0.25);
  EXPECT_LT(std::abs(at.y), 0.25);
  EXPECT_NEAR(at.z, -0.1, 0.05);
}

TEST_F(MeshObstacles, HoldBodiesInEquilibrium) {
  const auto squeezed = [&](const std::string& plate) {
    Way way("[solver]\nmethod = 'equilibrium'\nprecision = 'double'\n" + end +
                obstacle("shape = 'plane'\ntranslation = [0, 0, -0.1]\n") + plate + block(),
            1);
    way.solver.step();
    return way.contacts()[1].force.z;
  };
  const std::string motion =
      "translation = [0, 0, 0.3]\n[obstacle.motion]\ndisplacement = [0, 0, -0.004]\n"
      "duration = 1\n";
  const double expected = squeezed(obstacle("shape = 'box'\nsize = [1, 1, 0.4]\n" + motion));
  const double found = squeezed(mesh(test::box({-0.5, -0.5, -0.2}, {0.5, 0.5, 0.2}), motion));
  EXPECT_LT(expected, -10);
  EXPECT_NEAR(found, expected, 1e-4 * std::abs(expected));
}

TEST_F(MeshObstacles, AreKnownByTheirSurfaces) {
  const std::string more = "translation = [0, 0, -0.4]\n";
  const auto digest = [&](const Surface& surface) {
    return model_digest(build_model(parse_scene(dropped(mesh(surface, more)), "scene.toml")));
  };
  const std::uint64_t one = digest(test::sphere({}, 0.4, 3));
  EXPECT_EQ(one, digest(test::sphere({}, 0.4, 3)));
  EXPECT_NE(one, digest(test::sphere({}, 0.399, 3)));
}

TEST_F(MeshObstacles, AreRefusedIfTheyOverlapOrAreOpen) {
  const auto refusal = [&](const Surface& surface, const std::string& more) {
    try {
      build_model(parse_scene(dropped(mesh(surface, more)), "scene.toml"));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refusal(test::sphere({}, 0.4, 3), "translation = [0, 0, -0.3]\n"),
              ::testing::HasSubstr("m deep in obstacle \"obstacle 1\" at the start"));
  // The whole mesh lies inside the body.
  EXPECT_THAT(refusal(test::sphere({}, 0.06, 2), "translation = [0, 0, 0.15]\n"),
              ::testing::HasSubstr("m deep in obstacle \"obstacle 1\" at the start"));
  EXPECT_THAT(refusal(test::without(test::sphere({}, 0.4, 2), 3), "translation = [0, 0, -0.5]\n"),
              ::testing::AllOf(::testing::HasSubstr("mesh.obj: the surface is not closed"),
                               ::testing::HasSubstr("3 open edges")));
}

}  // namespace
}  // namespace phyxel
