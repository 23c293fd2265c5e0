/// Volume and centroid of the part of a body that lies in a region of space.
#pragma once

#include <span>

#include "phyxel/cloud.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

/// A part of a body.
struct BodyPiece {
  double volume = 0;  ///< [m^3]
  Vec3d centroid;     ///< [m]; undefined without a volume.
};

/// The part of the inside of a closed surface that lies in a box along the axes or in a ball, by
/// the divergence theorem: exact for boxes, to about 1e-4 for balls.
BodyPiece piece_in(const Surface& surface, const SpaceRegion& region);

}  // namespace phyxel
