/// The search for points of surfaces that may touch other bodies soon.
#pragma once

#include <span>
#include <vector>

#include "model/box.hpp"
#include "phyxel/model.hpp"
#include "solver/contact_passes.hpp"

namespace phyxel {

/// A phyxel of a surface near another body, as all ranks know it.
struct ContactCandidate {
  Vec3d now;         ///< Where it is [m].
  SurfaceSite site;  ///< What does not change of it.
  Index id = 0;      ///< Its index in the whole model.
  Index body = 0;    ///< Number of its body.
  int rank = 0;      ///< The rank that steps it.
  Index place = 0;   ///< Its number in that rank's layer.
};

/// Points beside bodies, and the phyxels of surfaces near them.
struct ContactRows {
  std::vector<ContactRow> rows;  ///< By point, then by body.
  std::vector<Index> near;       ///< Numbers of points, ascending in each row.
};

/// The boxes of the layer's phyxels of each body, grown by their ranges and half a
/// skin: bodies whose boxes do not overlap are out of each other's range. Of a share: collective.
/// @param position of each phyxel of the layer [m]
/// @param sites of each
std::vector<Box> boxes_of_bodies(const Model& model, std::span<const Vec3d> position,
                                 std::span<const SurfaceSite> sites, double skin);

/// Finds the rows of points with phyxels of other bodies' surfaces within the common range and a
/// skin. @param points ascending by their ids
ContactRows find_rows(const BodyContact& contact, std::span<const ContactCandidate> points,
                      double skin);

}  // namespace phyxel
