/// Surfaces that are copies of each other.
#pragma once

#include <optional>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// A rotation and a translation: a point x goes to turn x + place.
struct RigidMotion {
  Mat3d turn = identity<double>();
  Vec3d place;  ///< [m]
};

/// Finds the rigid motion that takes each vertex of a surface to the same vertex of another one, to
/// the rounding of coordinates. A translation has exactly the identity as its rotation.
/// @returns nothing if there is none, or if the triangles differ; a mirror image is no copy
std::optional<RigidMotion> rigid_motion_between(const Surface& from, const Surface& to);

}  // namespace phyxel
