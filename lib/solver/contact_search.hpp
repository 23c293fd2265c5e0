/// The search for points of surfaces that may touch other bodies soon.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "model/box.hpp"
#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"
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
  /// Numbers of points: for each row, `contact_threads` lists, in each of which they ascend.
  Csr near;

  /// The points near that of a row.
  std::span<const Index> near_row(std::size_t r) const {
    const Offset* start = near.offsets.data() + contact_threads * r;
    return {near.indices.data() + start[0], near.indices.data() + start[contact_threads]};
  }
};

/// Returns lists of numbers, each in the order of the entries. @param entries list and number of
/// each
Csr grouped(std::size_t lists, std::span<const std::pair<Index, Index>> entries);

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
