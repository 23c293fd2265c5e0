/// The patches of a surface near a point: parts that are far from each other at rest, such as two
/// limbs, or the walls of a fold.
#pragma once

#include "phyxel/physics/body_contact.hpp"

namespace phyxel {

/// Most patches of a surface near a point that are told apart.
inline constexpr int most_patches = 3;

/// The distance at rest, in ranges, from which on two phyxels near a point may be of two patches.
/// Phyxels of a flat surface are at most twice the range apart.
inline constexpr double ranges_between_patches = 2.5;

/// True if two phyxels near a point are far enough from each other at rest to be of two patches.
/// @param range of the point [m]
PHYXEL_HD bool are_far_at_rest(double range, const SurfaceSite& one, Vec3<double> other) {
  const double most = ranges_between_patches * common_range(range, one.range);
  const Vec3<double> way = other - one.rest;
  return dot(way, way) > most * most;
}

/// True if a phyxel near a point is far at rest from one of the others near it: patches may have to
/// be told apart. @param site_of returns the phyxels near the point. @param count their number
template <class Number, class SiteOf>
PHYXEL_HD bool is_far_from_others(double range, const SurfaceSite& one, Number count,
                                  SiteOf&& site_of) {
  for (Number k = 0; k < count; ++k) {
    if (are_far_at_rest(range, one, site_of(k).rest)) return true;
  }
  return false;
}

/// The patches of a surface near a point at one time. The middle of the first is the phyxel nearest
/// to the point, that of each other one the nearest phyxel that is far at rest from all middles
/// before it; phyxels are of the patch whose middle is nearest at rest. Only phyxels within the
/// range that face the point become middles, so that patches do not depend on what else is in a
/// list.
class SurfacePatches {
 public:
  /// The parameters are those of `surface_touch`. @param most number of patches, at most
  /// `most_patches`
  template <class Threads, class SiteOf, class MotionOf>
  PHYXEL_HD SurfacePatches(const Threads& threads, const SurfaceSite& site,
                           const SurfaceMotion& point, const Offset* list, SiteOf&& site_of,
                           MotionOf&& motion_of, int most) {
    for (; count_ < most; ++count_) {
      NearestPhyxel nearest;
      threads.each(list, [&](Offset k) {
        const SurfaceSite& other = site_of(k);
        const Vec3<double> apart = motion_of(k).after - point.after;
        const double square = dot(apart, apart), range = common_range(site.range, other.range);
        if (square >= nearest.square || square >= range * range) return;
        if (!(facing(point, motion_of(k)) > 0)) return;
        for (int p = 0; p < count_; ++p) {
          if (!are_far_at_rest(site.range, other, middle_[p])) return;
        }
        nearest = {square, other.rest};
      });
      nearest = threads.nearest(nearest);
      if (!(nearest.square < no_square)) return;
      middle_[count_] = nearest.rest;
    }
  }

  /// The number of patches.
  PHYXEL_HD int count() const { return count_; }
  /// The patch of a phyxel. @param rest its place at rest [m]
  PHYXEL_HD int of(Vec3<double> rest) const {
    int found = 0;
    double least = no_square;
    for (int p = 0; p < count_; ++p) {
      const Vec3<double> way = rest - middle_[p];
      const double square = dot(way, way);
      if (square >= least) continue;
      least = square;
      found = p;
    }
    return found;
  }

 private:
  Vec3<double> middle_[most_patches];  // at rest [m]
  int count_ = 0;
};

/// The threads of a pass, which leave out entries of other patches. @tparam Threads as `OneThread`
template <class Threads>
class OfPatch {
 public:
  /// @param in_patch true for the entries of the patch; null if all are
  PHYXEL_HD OfPatch(const Threads& threads, const char* in_patch)
      : threads_(threads), in_patch_(in_patch) {}

  /// As of `OneThread`, for the entries of the patch.
  template <class Each>
  PHYXEL_HD void each(const Offset* start, Each&& each) const {
    threads_.each(start, [&](Offset k) {
      if (!in_patch_ || in_patch_[k]) each(k);
    });
  }
  /// As of `OneThread`.
  template <class T>
  PHYXEL_HD T sum(const T& part) const {
    return threads_.sum(part);
  }

 private:
  const Threads& threads_;
  const char* in_patch_;
};

}  // namespace phyxel
