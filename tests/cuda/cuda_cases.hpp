/// Scenes of two bodies with any of the terms, for tests of the GPU solver, and comparisons of
/// states.
#pragma once

#include <algorithm>
#include <ostream>
#include <string>
#include <vector>

#include "phyxel/solver.hpp"
#include "support/clouds.hpp"

namespace phyxel::testing {

struct Case {
  const char* name;
  bool adaptive = false, capped = false, everything = false;
  bool closed = false;      ///< The first body has closed gradients.
  bool one_each = false;    ///< The second body has adaptive supports.
  bool inclusions = false;  ///< Of other materials, in the first body.
  bool plastic = false;     ///< The first body yields.
  bool viscous = false;     ///< All materials are viscous.
  bool pairs = false;       ///< The first body has supports of pairs.
};
inline void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

/// Two bodies of thousands of phyxels, sizes not multiples of a tile or a warp.
inline Scene scene_of(const Case& c) {
  Scene scene = one_body();
  scene.gravity = {0.3, 0, -9.81};
  BodyRequest body = scene.bodies[0];
  body.spin = {0, 1, 2};
  if (c.adaptive) body.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  if (c.capped) body.neighbourhood.max_neighbours = 24;
  scene.bodies = {body, body};
  BodyRequest &first = scene.bodies[0], &second = scene.bodies[1];
  if (c.closed) first.closure = 0.01;
  if (c.pairs) first.neighbourhood.support = NeighbourhoodRule::Support::pairwise;
  if (c.one_each) second.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  FixRequest fix;
  fix.select.box = Selection::Box{{-1, -1, -1}, {0.15, 3, 3}};
  first.fixed.push_back(fix);
  second.material.young = 4e5;
  if (c.everything) {
    first.material.volume_stiffness = 2e5;
    first.material.damping = 1.5;
    if (!c.adaptive) first.material.hourglass = 0.2;  // and the second has none
    if (c.adaptive) first.material.law = "neo-hookean";
    second.material.law = c.adaptive ? "corotated" : "small-strain";
    LoadRequest load;
    load.select.box = Selection::Box{{1.2, -1, -1}, {3, 3, 3}};
    load.force = {0, 30, 0};
    load.ramp = 0.02;
    first.loads.push_back(load);
    MotionRequest motion;
    motion.select.box = Selection::Box{{-1, -1, -1}, {3, 0.1, 3}};
    motion.velocity = {0.1, 0, 0};
    motion.amplitude = {0, 0.01, 0};
    motion.frequency = 3;
    second.motions.push_back(motion);
  }
  if (c.plastic) {
    first.material.law = "j2";
    first.material.parameters = {{"yield_stress", 1e4}, {"hardening", 5e4}};
  }
  if (c.viscous) {
    first.material.viscosity = 2e-4;
    second.material.viscosity = 1e-4;
  }
  if (c.inclusions) {
    Material hard = first.material, light = first.material;
    hard.young *= 4;
    hard.law = "neo-hookean";
    hard.parameters = {};
    light.poisson = 0.1;
    light.density *= 0.5;
    light.damping = 3;
    first.inclusions = {
        {.select = {.ball = Selection::Ball{{0.5, 0.3, 0.4}, 0.3}}, .material = hard},
        {.select = {.box = Selection::Box{{0.9, -1, -1}, {3, 3, 3}}}, .material = light}};
  }
  return scene;
}
/// A block with a surface, which its gradients are closed to, with a corner at the origin.
inline Cloud block(Vec3d size) {
  Cloud cloud = make_shape({.name = "block",
                            .size = size,
                            .spacing = 0.1,
                            .jitter = 0.2,
                            .placement = ShapeRequest::Placement::nodes});
  for (Vec3d& x : cloud.position) x += 0.5 * size;
  for (Vec3d& x : cloud.surface.position) x += 0.5 * size;
  return cloud;
}
inline Model model_of_case(const Case& c) {
  std::vector<Cloud> clouds{lattice(17, 13, 15, 0.1, 0.2, 3), lattice(9, 14, 8, 0.12, 0.1, 4)};
  if (c.closed) clouds[0] = block({1.6, 1.2, 1.4});
  return build_model(scene_of(c), clouds);
}

inline double largest(const std::vector<Vec3d>& values) {
  double most = 0;
  for (const Vec3d& v : values) most = std::max(most, norm(v));
  return most;
}
inline double apart(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  double most = 0;
  for (std::size_t i = 0; i < b.size(); ++i) most = std::max(most, norm(a[i] - b[i]));
  return most / largest(b);
}

inline State after(Backend& backend, const Model& model, const Scene& scene, double dt, int steps) {
  Solver solver(backend, initial_state(model, scene, dt));
  solver.step(steps);
  return solver.state();
}

}  // namespace phyxel::testing
