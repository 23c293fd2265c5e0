/// Thickness of a body at points of its surface.
#pragma once

#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// The thickness of a body at each of many points spread over its surface [m]: the distance, along
/// the inward normal, to the nearest point on the other side. Another point is on the other side if
/// its normal is nearly opposite, and if it does not lie beside the point. The thickness is
/// infinite where there is no such point within `farthest`.
/// @param place the points [m]
/// @param normal outward unit normals of the faces they lie on
/// @param farthest greatest distance between points on two sides [m]
std::vector<double> thicknesses(std::span<const Vec3d> place, std::span<const Vec3d> normal,
                                double farthest);

}  // namespace phyxel
