/// Triangulating the surface of an implicit body with a given number of vertices.
#pragma once

#include "shapes/implicit_body.hpp"

namespace phyxel {

/// A closed manifold surface of one part with exactly `vertices` vertices, all on the body's
/// surface, with triangles of about the same size: polygonised on a lattice that is fine enough,
/// then thinned by collapsing the shortest edge again and again, then smoothed.
/// Source: Botsch and Kobbelt 2004 (collapses, flips and tangential relaxation).
Surface mesh_body(const ImplicitBody& body, Index vertices);

}  // namespace phyxel
