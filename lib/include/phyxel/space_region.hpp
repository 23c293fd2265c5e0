/// Boxes and balls: the parts of space in which scenes select phyxels.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// A closed part of space: a box, which may be turned against the axes, or a ball.
struct SpaceRegion {
  /// Unit vectors along the edges of a box.
  std::array<Vec3d, 3> edge{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  /// Corners of a box [m], as products of their position with the unit vectors.
  Vec3d low, high;
  Vec3d centre;          ///< Centre of a ball [m].
  double radius = 0;     ///< Radius of a ball [m].
  bool is_ball = false;  ///< True for a ball, false for a box.

  /// True if the region contains a point or has it on its boundary.
  bool contains(Vec3d point) const;
  /// Distance of a point from the boundary [m]; negative inside.
  double distance(Vec3d point) const;
  /// The region made smaller by a distance [m] on all sides.
  SpaceRegion shrunk(double by) const;
  /// The point of the boundary nearest to `point`, moved inwards by `inset` [m].
  Vec3d nearest_on_boundary(Vec3d point, double inset = 0) const;
  /// The region of the points p whose images scale * rotation * p + translation lie in this one.
  SpaceRegion before_placement(double scale, const Mat3d& rotation, Vec3d translation) const;
  /// The region of the images scale * rotation * p + translation of the points p of this one.
  SpaceRegion placed(double scale, const Mat3d& rotation, Vec3d translation) const;
  /// The region multiplied by a positive factor about the origin.
  SpaceRegion scaled(double factor) const;

  bool operator==(const SpaceRegion&) const = default;
};

/// True if region a has a place before region b in an order by shape and coordinates. Supports are
/// laid in this order, so that the order of a scene's entries changes nothing.
bool comes_before(const SpaceRegion& a, const SpaceRegion& b);

/// A region of space in which a body is held or moved.
struct SupportRegion {
  SpaceRegion region;
  bool holds_all = true;  ///< True if its phyxels are held or moved along all axes.
  bool operator==(const SupportRegion&) const = default;
};

/// The regions of supports, in their order.
std::vector<SpaceRegion> regions_of(std::span<const SupportRegion> supports);

/// The boundaries at which supports part the phyxels of a body: regions inside which all phyxels
/// are held or moved along all axes.
struct Walls {
  std::vector<SpaceRegion> regions;
  double depth = 0;    ///< `SupportCuts::depth` [m].
  double spacing = 0;  ///< `SupportCuts::spacing` [m].

  /// The index of the region that a point is in; their number if it is in none. Phyxels on the
  /// boundary of a region are in none.
  std::size_t room_of(Vec3d point) const;
};

}  // namespace phyxel
