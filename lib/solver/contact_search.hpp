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

/// True if a phyxel of a surface comes into the list of a point, if their bodies touch.
PHYXEL_HD bool is_near(const ContactCandidate& point, const ContactCandidate& other, double skin) {
  // Points far apart would press on a fine surface like nails; it has points of its own. Edges
  // and corners act all the same, for they come between the points of a fine surface.
  constexpr double coarser = 1.5;
  if (!point.site.is_edge() && point.site.range > coarser * other.site.range) return false;
  const double range = common_range(point.site.range, other.site.range);
  const auto is_within = [](Vec3d way, double distance) {
    return dot(way, way) <= distance * distance;
  };
  if (!is_within(other.now - point.now, range + skin)) return false;
  return point.body != other.body ||
         !is_within(other.site.rest - point.site.rest, ranges_apart * range);
}

/// Numbers the patches of a body's surface near a point. Phyxels are of one patch if a chain of
/// them, each within `ranges_apart` ranges of the next at rest, connects them: two limbs that come
/// near a point are two patches. Patches are in the order of their first phyxels.
/// @param count number of phyxels. @param site_of returns that of a phyxel. @param patch_of returns
/// a reference to the number of its patch, which is set. @returns the number of patches
template <class SiteOf, class PatchOf>
PHYXEL_HD Index find_patches(Index count, SiteOf&& site_of, PatchOf&& patch_of) {
  const auto are_connected = [&](Index a, Index b) {
    const SurfaceSite &one = site_of(a), &other = site_of(b);
    const Vec3d way = other.rest - one.rest;
    const double most = ranges_apart * common_range(one.range, other.range);
    return dot(way, way) <= most * most;
  };
  bool are_one = true;
  for (Index k = 0; k < count; ++k) {
    are_one = are_one && are_connected(0, k);
    patch_of(k) = -1;
  }
  Index patches = 0;
  for (Index first = 0; first < count; ++first) {
    if (patch_of(first) >= 0) continue;
    patch_of(first) = patches;
    for (bool grows = true; grows;) {
      grows = false;
      for (Index k = first + 1; k < count; ++k) {
        bool joins = patch_of(k) < 0 && are_one;
        for (Index l = first; l < count && patch_of(k) < 0 && !joins; ++l) {
          joins = patch_of(l) == patches && are_connected(k, l);
        }
        if (!joins) continue;
        patch_of(k) = patches;
        grows = true;
      }
    }
    ++patches;
  }
  return patches;
}

/// The row of a point beside a patch of a body.
PHYXEL_HD ContactRow row_of(const ContactCandidate& point, Index number, Index body, Index patch,
                            const ContactLaw& law) {
  return {number, body, patch, law, body == point.body ? ranges_apart * point.site.range : 0};
}

/// True if a phyxel of a surface may be near a body whose phyxels are in a box.
/// @param box grown by the ranges of its phyxels
PHYXEL_HD bool may_be_near(Vec3d now, double range, double skin, const Box& box) {
  return overlap(grown({now, now}, range + 0.5 * skin), grown(box, 0.5 * skin));
}

/// The candidates of all ranks, ascending by their ids. Of a share: collective. @param some those
/// of this rank
std::vector<ContactCandidate> of_all_ranks(const Model& model, std::vector<ContactCandidate> some);

/// Finds the rows of points with phyxels of other bodies' surfaces within the common range and a
/// skin. @param points ascending by their ids
ContactRows find_rows(const BodyContact& contact, std::span<const ContactCandidate> points,
                      double skin);

}  // namespace phyxel
