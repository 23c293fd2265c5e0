#include "bench_body.hpp"

#include <cmath>

#include "phyxel/shapes.hpp"

namespace phyxel::app {

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
  body.material = {
      .young = 1e6, .poisson = 0.3, .density = 1000, .strain = Strain::green, .hourglass = 0};
  if (terms == "neo-hookean") body.material.law = Law::neo_hooke;
  if (terms == "corotated") body.material.law = Law::corotated;
  if (terms == "cauchy") body.material.strain = Strain::cauchy;
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
