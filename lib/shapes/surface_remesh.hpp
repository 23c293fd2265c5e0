/// Triangulation of the surface of an implicit body with a given number of vertices.
#pragma once

#include "shapes/implicit_body.hpp"

namespace phyxel {

/// A closed, connected, manifold surface with exactly `vertices` vertices on the body's surface and
/// triangles of about the same size. It is polygonised on a fine lattice, coarsened by repeated
/// collapse of the shortest edge, and smoothed.
/// Source: Botsch and Kobbelt 2004 (collapses, flips and tangential relaxation).
Surface mesh_body(const ImplicitBody& body, Index vertices);

}  // namespace phyxel
