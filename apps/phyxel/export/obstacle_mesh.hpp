/// Triangles of obstacles, for formats that know no other shapes.
#pragma once

#include "phyxel/cloud.hpp"
#include "phyxel/model.hpp"

namespace phyxel::app {

/// The surface of an obstacle in its own coordinates, as seen by the bodies: from within if it is
/// hollow. Round shapes have 64 sides, and their vertices lie on them. Normals are those of the
/// shape; the surface of a mesh has none, since its faces are flat.
/// @param middle of the bodies in the obstacle's coordinates [m] @param reach half the width of the
///   square that represents a plane, opposite `middle` [m]
Surface obstacle_mesh(const Obstacle& obstacle, Vec3d middle, double reach);

}  // namespace phyxel::app
