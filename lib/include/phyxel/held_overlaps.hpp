/// Overlaps of what supports hold or move: no force can keep such phyxels apart.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/solver.hpp"

namespace phyxel {

/// The deepest phyxel of a body, held or moved along all axes, in something that cannot give way
/// there: an obstacle, or phyxels of another body that are held or moved, too.
struct HeldOverlap {
  double depth = 0;    ///< [m]; of an obstacle, what has been added since the start. 0: none.
  double support = 0;  ///< The smaller support of the phyxels of both sides [m].
  Index body = -1;     ///< Number of the body in the scene.
  Index other = -1;    ///< Number of the other body, or of the obstacle.
  /// True if supports hold or move the body as a whole, and the other body, too.
  bool is_whole = false;

  /// The depth over the support.
  double share() const { return support > 0 ? depth / support : 0; }
};

/// The overlaps of a model at an instant.
struct HeldOverlaps {
  std::vector<HeldOverlap> of_obstacles;  ///< The deepest one in each obstacle.
  std::vector<HeldOverlap> of_bodies;     ///< The deepest one of each body in other bodies.

  /// Keeps the deeper ones of these and of those at another instant, of bodies that are held as
  /// wholes.
  void keep_wholes(const HeldOverlaps& now);
};

/// Finds the overlaps of held phyxels at the present time of a solver. They follow from motions
/// alone: nothing is downloaded, and models without supports cost nothing. Of a share: collective,
/// with the same result on all ranks.
/// @param rigid states of the free bodies
HeldOverlaps find_held_overlaps(const Model& model, const Solver& solver,
                                std::span<const RigidState> rigid);

/// The name of a body of the scene.
const std::string& name_of_body(const Model& model, Index body);

/// A warning of bodies that overlap although both are held or moved as wholes, or one of which
/// overlaps with an obstacle; empty if none do by more than rounding.
/// @param deepest overlaps at the frames of a run, as `HeldOverlaps::keep_wholes` has kept them
std::string warning_of_held_overlaps(const Model& model, const HeldOverlaps& deepest);

}  // namespace phyxel
