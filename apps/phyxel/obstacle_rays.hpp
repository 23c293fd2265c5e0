/// Rays that meet obstacles, by sphere tracing (Hart 1996): a shape's signed distance is all that
/// is needed of it.
#pragma once

#include <optional>
#include <vector>

#include "phyxel/model.hpp"
#include "rigid_paths.hpp"

namespace phyxel::app {

/// An obstacle where it is at a time.
struct PlacedObstacle {
  ObstacleForm form;  ///< Of an obstacle that must outlive this.
  ObstacleStep step;
  bool bounded = false;  ///< False if its shape has no end.
  Index number = 0;      ///< Among the obstacles of the scene.

  /// The distance of a place from its surface [m].
  double distance(Vec3d x) const;
};

/// The obstacles of a scene at a time [s]. @param paths of those that are free bodies
std::vector<PlacedObstacle> placed(const std::vector<Obstacle>& obstacles, const RigidPaths& paths,
                                   double time);

/// All rays from an eye near one of them.
struct Cone {
  Vec3d eye;          ///< [m]
  Vec3d direction;    ///< Unit vector.
  double spread = 0;  ///< Largest distance of the rays' unit vectors from `direction`.
};

/// The distance from the eye up to which no ray of a cone crosses an obstacle's surface [m].
/// @param from distance up to which that is known @param farthest where the search ends
double clear_distance(const PlacedObstacle& obstacle, const Cone& cone, double from,
                      double farthest);

/// Where a ray enters an obstacle.
struct Entry {
  double distance = 0;  ///< From the eye [m].
  Vec3d normal;         ///< Unit vector away from the obstacle.
};

/// Where the ray in the middle of a cone first enters an obstacle from outside. One that starts
/// inside leaves it first: so planes are seen from their front alone, and hollow obstacles from
/// within. @param cone with a spread that a picture resolves @param from,farthest as above
std::optional<Entry> first_entry(const PlacedObstacle& obstacle, const Cone& cone, double from,
                                 double farthest);

}  // namespace phyxel::app
