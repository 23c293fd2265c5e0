/// Small clouds and models for the tests.
#pragma once

#include <random>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel::testing {

inline double uniform(std::mt19937_64& engine, double low, double high) {
  return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
}
inline Vec3d uniform_vector(std::mt19937_64& engine, double amplitude) {
  const double x = uniform(engine, -amplitude, amplitude);
  const double y = uniform(engine, -amplitude, amplitude);
  return {x, y, uniform(engine, -amplitude, amplitude)};
}

/// Returns nx × ny × nz phyxels of equal volume at the centres of cells, each moved by up to
/// `jitter` spacings.
inline Cloud lattice(int nx, int ny, int nz, double spacing, double jitter = 0,
                     std::uint64_t seed = 1) {
  std::mt19937_64 engine(seed);
  Cloud cloud;
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        const Vec3d centre{x + 0.5, y + 0.5, z + 0.5};
        cloud.position.push_back(spacing * (centre + uniform_vector(engine, jitter)));
        cloud.volume.push_back(spacing * spacing * spacing);
      }
    }
  }
  return cloud;
}

/// Maps a cloud over the cube from 0 to `side` by an inversion, which keeps angles, and a
/// reflection. Spacings vary 8.5 to 1 along x.
inline Cloud inverted(Cloud cloud, double side, double spacing) {
  const Vec3d centre{-0.6 * side, side / 2, side / 2};
  const double radius2 = side * side;
  const auto map = [&](Vec3d p) {
    const Vec3d d = p - centre, image = centre + (radius2 / dot(d, d)) * d;
    return Vec3d{image.x, image.y, side - image.z};
  };
  cloud.spacing.clear();
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    const Vec3d d = cloud.position[i] - centre;
    const double growth = radius2 / dot(d, d);
    cloud.position[i] = map(cloud.position[i]);
    cloud.volume[i] *= growth * growth * growth;
    cloud.spacing.push_back(spacing * growth);
  }
  for (Vec3d& p : cloud.surface.position) p = map(p);
  if (!cloud.surface.position.empty()) {
    cloud.surface.normal = vertex_normals(cloud.surface.position, cloud.surface.triangle);
  }
  cloud.lattice = false;
  return cloud;
}

/// A graded cloud of n³ phyxels with spacings of their own, which vary 8.5 to 1.
inline Cloud graded(int n, double jitter = 0.2, std::uint64_t seed = 1) {
  return inverted(lattice(n, n, n, 1.0 / n, jitter, seed), 1, 1.0 / n);
}

inline Material rubber() {
  return {.young = 1e5,
          .poisson = 0.3,
          .density = 1000,
          .law = StVenantKirchhoff<double>::name,
          .hourglass = 0};
}

/// A scene of one body named "body" without loads or gravity.
inline Scene one_body(const Material& material = rubber(), const NeighbourhoodRule& rule = {}) {
  Scene scene;
  scene.time.end = 1;
  BodyRequest body;
  body.name = "body";
  body.where = "test.toml:1:1";
  body.material = material;
  body.neighbourhood = rule;
  scene.bodies.push_back(body);
  return scene;
}

inline Model model_of(const Scene& scene, const Cloud& cloud) {
  return build_model(scene, std::span(&cloud, 1));
}

/// A small irregular block with all terms in use.
inline Scene busy_scene() {
  Material material = rubber();
  material.volume_stiffness = 5e4;
  Scene scene = one_body(material);
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].spin = {0, 3, 1};
  FixRequest fix;
  fix.select.box = Selection::Box{{-1, -1, -1}, {0.15, 1, 1}};
  scene.bodies[0].fixed.push_back(fix);
  LoadRequest load;
  load.select.box = Selection::Box{{0.65, -1, -1}, {2, 1, 1}};
  load.force = {0, 3, 0};
  load.ramp = 0.05;
  scene.bodies[0].loads.push_back(load);
  return scene;
}

inline Model busy_model() { return model_of(busy_scene(), lattice(8, 3, 4, 0.1, 0.2)); }

/// Two built-in bodies far apart, with their surfels.
inline Model built_in_bodies(
    const char* first, const char* second,
    NeighbourhoodRule::Support support = NeighbourhoodRule::Support::uniform) {
  Scene scene;
  for (const char* shape : {first, second}) {
    BodyRequest body;
    body.name = shape;
    body.where = "test";
    body.source.shape.name = shape;
    body.translation = {scene.bodies.empty() ? 0.0 : 40.0, 0, 0};
    body.material = rubber();
    body.neighbourhood.support = support;
    scene.bodies.push_back(body);
  }
  return build_model(scene);
}

/// Removes lists and moments, as if a device computed them.
inline Model without_lists(Model model) {
  model.neighbourhood.neighbours = model.neighbourhood.inverse_lists = {};
  model.inverse_moment.clear();
  model.moment_offset.clear();
  return model;
}

inline State state_of(const std::vector<Vec3d>& displacement, double dt = 1e-3) {
  State state;
  state.displacement = displacement;
  state.velocity.resize(displacement.size());
  state.dt = dt;
  return state;
}

/// A large smooth deformation with a random part on top.
inline std::vector<Vec3d> random_deformation(const Model& model, double roughness,
                                             std::uint64_t seed = 7) {
  std::mt19937_64 engine(seed);
  Mat3d g;
  for (int e = 0; e < 9; ++e) g(e / 3, e % 3) = uniform(engine, -0.3, 0.3);
  std::vector<Vec3d> u;
  for (const Vec3d& x : model.position) u.push_back(g * x + uniform_vector(engine, roughness));
  return u;
}

}  // namespace phyxel::testing
