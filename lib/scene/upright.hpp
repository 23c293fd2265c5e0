/// Axes for pictures of scenes whose "up" is not z.
#pragma once

#include <array>

#include "phyxel/types.hpp"

namespace phyxel {

/// What the smallest rotation that turns z to `up` makes of the axes x, y and z: the last is `up`,
/// of length 1. @param up not zero
inline std::array<Vec3d, 3> upright_axes(Vec3d up) {
  const Vec3d u = normalised(up);
  if (u.z < -1 + 1e-12) return {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
  const double share = 1 / (1 + u.z);  // Rodrigues' formula about z x u
  return {{{1 - u.x * u.x * share, -u.x * u.y * share, -u.x},
           {-u.x * u.y * share, 1 - u.y * u.y * share, -u.y},
           u}};
}

}  // namespace phyxel
