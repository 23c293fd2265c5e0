/// Clouds of round bodies, whose phyxels lie on their surfaces: lattices that are bent, rings, and
/// meshes.
#pragma once

#include "accuracy/accuracy.hpp"

namespace phyxel::app {

/// A quarter of a tube about the z axis, x and y >= 0, 0 <= z <= two spacings: three layers.
/// `across` counts cells of the wall. Nodes or a mesh.
Cloud quarter_tube(const Discretisation& d, double inner_radius, double outer_radius);
/// A quarter of a cylinder about the z axis, x and y >= 0, 0 <= z <= two spacings: three layers,
/// with its surface. `across` counts cells of the diameter. Nodes or a mesh.
Cloud quarter_of_cylinder(const Discretisation& d, double radius);
/// The thickness of that slice [m].
double thickness_of_slice(const Discretisation& d, double radius);
/// A strap on the upper half of a drum about the z axis, 0 <= z <= two spacings, with its surface
/// and straight tails from y = 0 down to -`tail`. `across` counts cells of the thickness. Nodes or
/// a mesh.
Cloud strap_on_drum(const Discretisation& d, double radius, double thickness, double tail);
/// An eighth of a hollow sphere, x, y and z >= 0. `across` counts cells of the wall. Nodes or a
/// mesh.
Cloud eighth_of_shell(const Discretisation& d, double inner_radius, double outer_radius);
/// An eighth of a ball about the origin, x, y and z >= 0, with its surface. `across` counts cells
/// of the diameter. Nodes or a mesh.
Cloud eighth_of_ball(const Discretisation& d, double radius);
/// A cylinder about the z axis from z = 0 to `length`. `across` counts cells of the diameter. Nodes
/// are rings of 6, 12, 18 ... about the axis; cells, those of the built-in shape, with surfels. The
/// region "z-" is the end at z = 0.
Cloud rod(const Discretisation& d, double radius, double length);

}  // namespace phyxel::app
