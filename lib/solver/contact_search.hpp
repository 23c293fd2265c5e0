/// The search for points of surfaces that may touch other bodies soon.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "model/box.hpp"
#include "model/box_overlaps.hpp"
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
  std::vector<ContactRow> rows;  ///< By point, then by body, then by patch.
  /// Numbers of points: for each row, `contact_threads` lists, in each of which they ascend.
  Csr near;

  /// True if a point is beside several patches of a body.
  bool have_patches() const;

  /// The points near that of a row.
  std::span<const Index> near_row(std::size_t r) const {
    const Offset* start = near.offsets.data() + contact_threads * r;
    return {near.indices.data() + start[0], near.indices.data() + start[contact_threads]};
  }
};

/// Returns lists of numbers, each in the order of the entries. @param entries list and number of
/// each
Csr grouped(std::size_t lists, std::span<const std::pair<Index, Index>> entries);

/// Parts of one body that are nearer to each other at rest, in ranges, do not touch.
inline constexpr double ranges_apart = 2;

/// The part of a list that a phyxel is in.
PHYXEL_HD int part_of_list(const ContactCandidate& point) { return point.id % contact_threads; }

/// The skin of two bodies [m], by which lists of the points of one near the other reach beyond
/// ranges: the smaller one of theirs. A body's skin lasts for the fastest of those that it may soon
/// meet, which has one as wide; bodies that are slow against each other have short lists. Equal on
/// all ranks.
/// @param skins of all bodies [m]
PHYXEL_HD double skin_of(const double* skins, Index a, Index b) {
  return skins[a] < skins[b] ? skins[a] : skins[b];
}

/// True if a phyxel of a surface comes into the list of a point, if their bodies touch.
/// @param skins of the bodies [m]
PHYXEL_HD bool is_near(const ContactCandidate& point, const ContactCandidate& other,
                       const double* skins) {
  // Points far apart would press on a fine surface like nails; it has points of its own. Edges
  // and corners act all the same, for they come between the points of a fine surface.
  constexpr double coarser = 1.5;
  if (!point.site.is_edge() && point.site.range > coarser * other.site.range) return false;
  const double range = common_range(point.site.range, other.site.range);
  const auto is_within = [](Vec3d way, double distance) {
    return dot(way, way) <= distance * distance;
  };
  const double skin = skin_of(skins, point.body, other.body);
  if (!is_within(other.now - point.now, range + skin)) return false;
  return point.body != other.body ||
         !is_within(other.site.rest - point.site.rest, ranges_apart * range);
}

/// The row of a point beside a patch of a body.
PHYXEL_HD ContactRow row_of(const ContactCandidate& point, Index number, Index body, Index patch,
                            Index patches, const ContactLaw& law) {
  return {number,  body, patch,
          patches, law,  body == point.body ? ranges_apart * point.site.range : 0};
}

/// True if a phyxel of a surface may be near a body whose phyxels are in a box.
/// @param box grown by the ranges of its phyxels. @param skin of both bodies [m]
PHYXEL_HD bool may_be_near(Vec3d now, double range, double skin, const Box& box) {
  return overlap(grown({now, now}, range + 0.5 * skin), grown(box, 0.5 * skin));
}

/// The candidates of all ranks, ascending by their ids. Of a share: collective. @param some those
/// of this rank
std::vector<ContactCandidate> of_all_ranks(const Model& model, std::vector<ContactCandidate> some);

/// Finds the rows of points with phyxels of other bodies' surfaces within the common range and the
/// skin of both bodies. @param points ascending by their ids. @param skins of the bodies [m]
ContactRows find_rows(const BodyContact& contact, std::span<const ContactCandidate> points,
                      std::span<const double> skins);

}  // namespace phyxel
