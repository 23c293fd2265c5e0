/// The bar that most problems are about.
#pragma once

#include "accuracy/accuracy.hpp"

namespace phyxel::app {

inline constexpr double E = 1e6, nu = 0.3, rho = 1000;  // [Pa], -, [kg/m³]

ShapeRequest::Placement placement_of(Filling filling);

/// A bar along x, whose outer layers of phyxels are `length` apart: on cells, layers lie half a
/// spacing inside.
Scene bar(const Discretisation& d, double length, double side, double poisson = nu);
/// Its end at x = 0 held.
Scene clamped(Scene scene);
/// The phyxels of its first body, with the regions of a shape's faces.
Cloud cloud_of(const Scene& scene, const Discretisation& d);

/// Mean of vectors over some phyxels, by volumes.
Vec3d mean_of(const Model& model, const std::vector<Index>& phyxels, const std::vector<Vec3d>& v);

}  // namespace phyxel::app
