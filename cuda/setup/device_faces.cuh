/// Points on the faces of a surface, on the device.
#pragma once

#include <span>
#include <vector>

#include "mesh/filling_device.hpp"

namespace phyxel::cuda {

/// Does what `SurfaceOnDevice::darts` promises.
std::vector<Vec3d> darts_on_device(std::span<const Vec3d> candidates, std::span<const Vec3d> before,
                                   double gap, std::uint64_t seed);

/// The places of the points that move as `SurfaceOnDevice::even_out` promises [m].
std::vector<Vec3d> evened_out(std::span<const Vec3d> point, const PointsOnFaces& faces);

}  // namespace phyxel::cuda
