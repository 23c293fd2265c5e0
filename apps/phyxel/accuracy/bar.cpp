#include "accuracy/bar.hpp"

#include "phyxel/mesh.hpp"

namespace phyxel::app {

const char* filling_name(Filling filling) {
  switch (filling) {
    case Filling::nodes:
      return "nodes";
    case Filling::cells:
      return "cells";
    case Filling::mesh:
      return "mesh";
  }
  return "";
}

ShapeRequest::Placement placement_of(Filling filling) {
  return filling == Filling::cells ? ShapeRequest::Placement::cells
                                   : ShapeRequest::Placement::nodes;
}

Scene bar(const Discretisation& d, double length, double side, double poisson) {
  const double spacing = side / d.across;
  const bool nodes = d.filling != Filling::cells;
  BodyRequest body;
  body.name = "bar";
  body.where = "phyxel accuracy";
  body.source.shape = {.name = "beam",
                       .size = {nodes ? length : length + spacing, side, side},
                       .spacing = spacing,
                       .jitter = d.jitter,
                       .placement = placement_of(d.filling),
                       .surface = d.closure > 0};
  body.material = {
      .young = E, .poisson = poisson, .density = rho, .law = d.law, .hourglass = d.hourglass};
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

Cloud cloud_of(const Scene& scene, const Discretisation& d) {
  BodyRequest body = scene.bodies[0];
  if (d.filling != Filling::mesh) return make_cloud(body);
  body.source.shape.surface = true;
  const Cloud lattice = make_cloud(body);
  // The groups of the sides become regions.
  Cloud cloud =
      sample_surface(lattice.surface,
                     {.phyxels = static_cast<Index>(lattice.position.size()), .on_surface = true});
  if (d.closure == 0) cloud.surface = {};
  return cloud;
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
