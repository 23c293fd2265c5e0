/// The bar of most problems.
#pragma once

#include "accuracy/accuracy.hpp"

namespace phyxel::app {

inline constexpr double E = 1e6, nu = 0.3, rho = 1000;  // [Pa], -, [kg/m³]

ShapeRequest::Placement placement_of(Filling filling);

/// A bar along x whose outer layers of phyxels are `length` apart; with phyxels in cells, the
/// layers are half a spacing inside the body.
Scene bar(const Discretisation& d, double length, double side, double poisson = nu);
/// The scene with the end at x = 0 fixed.
Scene clamped(Scene scene);
/// The cloud of the scene's first body, with regions of its faces.
Cloud cloud_of(const Scene& scene, const Discretisation& d);

/// Volume-weighted mean of vectors over some phyxels.
Vec3d mean_of(const Model& model, const std::vector<Index>& phyxels, const std::vector<Vec3d>& v);

}  // namespace phyxel::app
