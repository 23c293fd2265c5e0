/// The scene, the start and the caller's forces of a combination.
#pragma once

#include <memory>
#include <random>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/solver.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"
#include "support/pairs/combinations.hpp"

namespace phyxel::testing {

/// Soft rubber of a law of the library. A law with a history yields at strains of 1%: moduli of its
/// own are a tenth of those of `rubber_of`, and it hardens.
inline Material material_of_law(const std::string& name) {
  Material material = rubber_of(name);
  for (const LawEntry& entry : law_table()) {
    if (name != entry.name || entry.history.empty()) continue;
    for (const LawParameter& p : entry.parameters) {
      const auto own = material.parameters.find(p.name);
      if (own != material.parameters.end() && p.unit == std::string("Pa")) {
        own->second = typical_value(p, 0.01);
      }
    }
    if (has_parameter(name, "hardening")) material.parameters["hardening"] = 1e4;
  }
  return material;
}

/// The law of a combination, in the library or a caller's, without terms.
inline Material own_law(const Combination& row) {
  if (row.is(law, custom)) {
    Material material = rubber();
    material.custom_law = std::make_shared<Repeated>(material);
    return material;
  }
  if (row.is(law, custom_history)) {
    Material material = material_of_law(J2<double>::name);
    material.custom_law = std::make_shared<Borrowed>(material);
    return material;
  }
  return material_of_law(row.value(law));
}

/// Adds the terms of a combination to a material.
inline Material with_terms(const Combination& row, Material material) {
  material.volume_stiffness = row.has(volume) ? 5e4 : 0;
  material.viscosity = row.has(viscosity) ? 1e-3 : 0;
  material.damping = row.has(damping) ? 3 : 0;
  material.hourglass = row.has_hourglass() ? 0.1 : 0;
  return material;
}

/// The law of an inclusion: the next one of the table, so that every law stands beside another.
inline std::string law_of_inclusion(const Combination& row) {
  const auto table = law_table();
  for (std::size_t k = 0; k + 1 < table.size(); ++k) {
    if (row.is(law, table[k].name)) return table[k + 1].name;
  }
  return table[0].name;
}

inline Selection in_box(Vec3d low, Vec3d high) {
  Selection select;
  select.box = Selection::Box{low, high};
  return select;
}

/// Fixed, moved and loaded phyxels, and gravity. A free body is without gravity, so that it has an
/// equilibrium.
inline void set_boundary(const Combination& row, Scene& scene) {
  BodyRequest& body = scene.bodies[0];
  if (row.is(boundary, "free")) return;
  scene.gravity = {0.05, 0.02, -0.1};
  const Selection low = in_box({-1, -1, -1}, {0.07, 1, 1}),
                  high = in_box({0.73, -1, -1}, {2, 1, 1});
  if (row.is(boundary, "rollers")) {
    body.fixed.push_back({low, {.x = true, .y = false, .z = false}});
    body.fixed.push_back(
        {in_box({-1, -1, -1}, {2, -0.07, 1}), {.x = false, .y = true, .z = false}});
    body.fixed.push_back({in_box({-1, -1, -1}, {2, 1, -0.1}), {.x = false, .y = false, .z = true}});
    return;
  }
  body.fixed.push_back({low});
  if (row.is(boundary, "pressure")) {
    body.tractions.push_back({.select = {.all = true}, .pressure = 500, .follower = true});
    body.tractions.push_back(
        {.select = {.all = true}, .pressure = -200, .follower = true, .ramp = 0.02});
  }
  if (row.is(boundary, "moved")) {
    body.motions.push_back({.select = high,
                            .displacement = {0.03, 0.01, 0},
                            .rotation = {5, 0, 0},
                            .about = {0.8, 0, 0},
                            .duration = 0.02});
  }
  if (row.is(boundary, "loaded") || row.is(boundary, "growing loads")) {
    const double ramp = row.is(boundary, "loaded") ? 0 : 0.02;
    body.loads.push_back({.select = high, .force = {20, 1, 3}, .ramp = ramp});
    body.loads.push_back({.select = {.all = true}, .force_density = {0, 30, 0}});
    if (ramp > 0) {
      body.loads.push_back({.select = {.all = true},
                            .force_density = {0, 0, 40},
                            .curve = {{0.001, 1}, {0.02, -1.5}, {0.04, 0.5}}});
    }
  }
}

/// One body from x = 0 to 0.8 m with a closed surface: a beam with phyxels on its faces, a cylinder
/// of a jittered lattice, or a ring from a mesh, with phyxels on its surface. Of some hundred
/// phyxels on the CPU; on a GPU of three tiles and more, so that three ranks have some each.
inline BodyRequest shape_of(const Combination& row) {
  BodyRequest body;
  body.name = "body";
  body.where = "pairs.toml:1:1";
  ShapeRequest& shape = body.source.shape;
  if (row.is(cloud, "filled mesh")) {
    body.source.mesh = PHYXEL_SOURCE_DIR "/examples/mesh/ring.obj";
    body.source.phyxels = row.on_gpu() ? 800 : 400;
    body.source.relaxations = 10;
    body.scale = 0.8 / 0.94;
    body.translation = {0.4, 0, 0};
    return body;
  }
  shape.spacing = row.on_gpu() ? 0.05 : 0.08;
  if (row.is(cloud, "lattice")) {
    shape.name = "beam";
    shape.size = {0.8, 0.32, 0.32};
    shape.placement = ShapeRequest::Placement::nodes;
  } else {
    shape.name = "cylinder";
    shape.radius = 0.18;
    shape.length = 0.8;
    shape.jitter = 0.25;
    body.rotation = {0, 90, 0};
    body.translation = {0.4, 0, 0};
  }
  return body;
}

inline Scene scene_of(const Combination& row) {
  Scene scene;
  scene.time.end = 1;
  scene.solver.method = row.time_method();
  scene.solver.precision = row.working_precision();
  BodyRequest& body = scene.bodies.emplace_back(shape_of(row));
  body.material = with_terms(row, own_law(row));
  body.closure = row.is_closed() ? 1e-3 : 0;
  body.velocity = {0.3, -0.2, 0.1};
  body.spin = {1, 2, 3};
  if (row.is(supports, "adaptive supports")) {
    body.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  } else if (row.is(supports, "supports of pairs")) {
    body.neighbourhood.support = NeighbourhoodRule::Support::pairwise;
  } else if (row.is(supports, "capped lists")) {
    body.neighbourhood.max_neighbours = 20;
  }
  if (row.has(inclusions)) {
    Material other = with_terms(row, material_of_law(law_of_inclusion(row)));
    other.young *= 3;
    other.density *= 2;
    body.inclusions.push_back({in_box({0.3, -1, -1}, {0.5, 1, 0.05}), other});
  }
  set_boundary(row, scene);
  return scene;
}

/// Forces that pull pairs of phyxels apart, along the lines that join them at rest [N], shape [n]
/// of the whole model. They have no sum and no torque and stretch the body, so that a free body has
/// an equilibrium, which is stable. Empty for a combination without external forces.
inline std::vector<Vec3d> external_forces_of(const Combination& row, const Model& whole) {
  if (!row.has(external)) return {};
  const Index n = whole.size();
  std::vector<Vec3d> force(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) {
    const Index j = static_cast<Index>((7 * static_cast<std::int64_t>(i) + 3) % n);
    const Vec3d pull = 0.3 * (whole.position[i] - whole.position[j]);
    force[i] += pull;
    force[j] = force[j] - pull;
  }
  return force;
}

/// The start of the whole model: for methods in time a strain of 5% with an irregular part, zero
/// along prescribed axes.
inline State start_of(const Combination& row, const Scene& scene, const Model& whole, double dt) {
  State state = initial_state(whole, scene, dt);
  if (row.is(method, "equilibrium")) return state;
  std::mt19937_64 engine(11);
  Mat3d g;
  for (int e = 0; e < 9; ++e) g(e / 3, e % 3) = uniform(engine, -0.05, 0.05);
  for (Index i = 0; i < whole.size(); ++i) {
    state.displacement[i] = g * whole.position[i] + uniform_vector(engine, 0.002);
  }
  for (const Motion& motion : whole.motions) {
    for (const Index i : motion.phyxels) {
      state.displacement[i] = motion.along_axes({}, state.displacement[i]);
    }
  }
  return state;
}

}  // namespace phyxel::testing
