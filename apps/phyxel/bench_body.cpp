#include "bench_body.hpp"

#include <cmath>

#include "phyxel/law_table.hpp"
#include "phyxel/shapes.hpp"

namespace phyxel::app {
namespace {

/// A law's name in tables of `bench step`. The two laws of Hooke are named by their strain, as in
/// tables of earlier versions.
std::string term_of(const LawEntry& law) {
  const std::string name = law.name;
  if (name == StVenantKirchhoff<double>::name) return "green";
  return name == SmallStrain<double>::name ? "cauchy" : name;
}

}  // namespace

std::vector<std::string> bench_terms() {
  std::vector<std::string> terms;
  for (const LawEntry& law : law_table()) terms.push_back(term_of(law));
  for (const char* term :
       {"volume", "hourglass", "closure", "damping", "load", "adaptive", "surfels"}) {
    terms.emplace_back(term);
  }
  return terms;
}

Cloud bench_cube(Index n, bool surfels) {
  const double side = std::round(std::cbrt(static_cast<double>(n))) * 0.1;
  return make_shape({.name = "block",
                     .size = {side, side, side},
                     .spacing = 0.1,
                     .jitter = 0.1,
                     .surface = surfels});
}

Scene bench_scene(const std::string& terms, double factor, int bodies) {
  Scene scene;
  scene.gravity = {0, 0, -9.81};
  BodyRequest body;
  body.name = "cube";
  body.material = {.young = 1e6, .poisson = 0.3, .density = 1000, .hourglass = 0};
  for (const LawEntry& law : law_table()) {
    if (term_of(law) != terms) continue;
    body.material.law = law.name;
    for (const LawParameter& p : law.parameters) {
      if (p.required() && is_own_parameter(p)) body.material.parameters[p.name] = p.typical;
    }
  }
  if (terms == "volume") body.material.volume_stiffness = 1e6;
  if (terms == "hourglass") body.material.hourglass = 0.1;
  if (terms == "closure") body.closure = 0.01;
  if (terms == "damping") body.material.damping = 0.1;
  if (terms == "load") body.loads.push_back({.select = {.all = true}, .force = {1, 0, 0}});
  if (terms == "adaptive") body.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  body.neighbourhood.factor = factor;
  scene.bodies.assign(static_cast<std::size_t>(bodies), body);
  return scene;
}

}  // namespace phyxel::app
