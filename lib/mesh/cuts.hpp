/// Curves and faces along which the boundaries of regions of space cut a body.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "mesh/spacing_field.hpp"
#include "model/spatial_hash.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

/// A straight piece of a sharp edge, or of a curve on a surface.
struct Crease {
  Vec3d from, to;  ///< Ends [m].
};

/// Where a region is to cut a body.
struct PlannedCut {
  bool is_cut = false;      ///< True if phyxels are to lie on the boundary.
  bool has_inside = false;  ///< True if phyxels will also lie inside.
  /// The region, but beyond the body where it ends nearly where the body does; or, of a region that
  /// is too thin for two layers of phyxels, the half whose boundary is in its middle.
  SpaceRegion boundary;
};
/// Plans the cut of a region. @param spacing of the phyxels [m]
PlannedCut plan_cut(const InsideSampler& sampler, const Surface& surface, const SpaceRegion& region,
                    double spacing);

/// The curves along which the boundary of a region cuts a surface.
struct CuttingCurves {
  std::vector<Crease> piece;  ///< Pieces of the curves.
  std::vector<Vec3d> sharp;   ///< Places where boundary and surface meet at a sharp angle [m].
};
/// Finds the curves along which the boundary of a region cuts a surface.
/// @param step greatest length of a piece [m]
CuttingCurves cutting_curves(const Surface& surface, const SpaceRegion& region, double step);

/// The points at which creases cross the boundaries of regions [m]. Of two crossings within `step`
/// [m] of each other, both may be missed.
std::vector<Vec3d> crossings(std::span<const Crease> creases, std::span<const SpaceRegion> regions,
                             double step);

/// Points spread evenly over that part of a region's boundary which lies inside a surface, one on
/// each square of `gap` [m].
std::vector<Vec3d> points_on_cut(const InsideSampler& sampler, const SpaceRegion& region,
                                 double gap, std::uint64_t seed);

/// The part of a region's boundary that lies inside a surface.
struct CutFace {
  SpaceRegion region;
  std::vector<Vec3d> points;  ///< Points spread evenly over the face [m]: `points_on_cut`.
  double gap = 0;             ///< Each point stands for a square of this side [m].
  CuttingCurves border;       ///< The curves along which the face meets the surface.
};

/// The places of a surface that are too near to a cut for phyxels of their own: they lie in the
/// wedge beside a curve along which the two meet at a sharp angle, where a phyxel would have hardly
/// any volume. Phyxels on the cut itself, where it meets the surface, do not count as near.
class CutMargin {
 public:
  /// @param faces the cuts; none: the margin is empty. @param spacing of the phyxels
  /// The arguments must outlive the margin.
  CutMargin(const InsideSampler& sampler, std::span<const CutFace> faces,
            const SpacingField& spacing);

  bool is_empty() const { return faces_.empty(); }
  /// True if a place on the surface lies in the margin.
  bool contains(Vec3d place) const;

 private:
  bool is_thin(Vec3d place, const SpaceRegion& region, double spacing) const;

  /// A face that meets the surface at a sharp angle somewhere.
  struct Face {
    SpaceRegion region;
    SpatialHash points;  ///< Points of the face and its border.
    SpatialHash sharp;   ///< Places of the border where the angle is sharp.
  };

  const InsideSampler& sampler_;
  const SpacingField& spacing_;
  std::vector<Face> faces_;
};

}  // namespace phyxel
