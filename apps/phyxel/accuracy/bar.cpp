#include "accuracy/bar.hpp"

namespace phyxel::app {

Scene bar(const Discretisation& d, double length, double side, double poisson) {
  const double spacing = side / d.across;
  const bool nodes = d.placement == ShapeRequest::Placement::nodes;
  BodyRequest body;
  body.name = "bar";
  body.where = "phyxel accuracy";
  body.source.shape = {.name = "beam",
                       .size = {nodes ? length : length + spacing, side, side},
                       .spacing = spacing,
                       .jitter = d.jitter,
                       .placement = d.placement,
                       .surface = d.closure > 0};
  body.material = {.young = E, .poisson = poisson, .density = rho, .hourglass = d.hourglass};
  body.neighbourhood.factor = d.factor;
  body.closure = d.closure;
  Scene scene;
  scene.bodies.push_back(body);
  return scene;
}

Scene clamped(Scene scene) {
  scene.bodies[0].fixed.push_back({.select = {.region = "x-"}});
  return scene;
}

Vec3d mean_of(const Model& model, const std::vector<Index>& phyxels, const std::vector<Vec3d>& v) {
  Vec3d sum;
  double volume = 0;
  for (const Index i : phyxels) {
    sum += model.volume[i] * v[i];
    volume += model.volume[i];
  }
  return (1 / volume) * sum;
}

}  // namespace phyxel::app
