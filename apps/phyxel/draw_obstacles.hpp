/// Obstacles in pictures.
#pragma once

#include <functional>
#include <span>

#include "obstacle_rays.hpp"
#include "rasteriser.hpp"

namespace phyxel::app {

/// How obstacles vanish with their distance from the bodies, so that a floor has no horizon.
struct Fade {
  Vec3d middle;               ///< Of the bodies [m].
  double begin = 0, end = 0;  ///< Distances at which obstacles begin to vanish and are gone [m].

  /// The opacity of a place of an obstacle, 0 to 1.
  float opacity(Vec3d place) const;
};

/// The colour of an obstacle. @param bounded false for a plane
Colour obstacle_colour(bool bounded);

/// The number by which the samples of an obstacle are told from those of bodies.
inline Index body_of_obstacle(Index number) { return -2 - number; }

/// The share of the strongest light that reaches a place [m] of a body or obstacle, 0 to 1.
using Lighting = std::function<float(Vec3d place, Index body)>;

/// Draws obstacles as they are seen from outside them: planes from their front, hollow obstacles
/// from within. Equal input gives equal pictures.
void draw_obstacles(Rasteriser& rasteriser, std::span<const PlacedObstacle> obstacles,
                    const Fade& fade, const Lighting& lighting);

}  // namespace phyxel::app
