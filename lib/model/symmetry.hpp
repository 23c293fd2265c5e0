/// Planes of symmetry at which bodies end: the phyxels that they hold.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "model/box.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

/// The extent of a body at rest.
struct BodyExtent {
  Box box;             ///< Around its surface; around its phyxels if it has none [m].
  double spacing = 0;  ///< Of its phyxels, on average [m].
  bool has_surface = false;
};
/// Returns the extent of a body in place. @param phyxels box around all its phyxels
/// @param size number of its phyxels
BodyExtent extent_of(const Box& phyxels, const Surface& surface, Index size);

/// The phyxels at a plane of symmetry.
struct PlaneCounts {
  std::int64_t on = 0;    ///< On the plane, within a hundredth of a spacing.
  std::int64_t near = 0;  ///< Within three quarters of a spacing.
};
/// The spacing at a phyxel of a graded body, by its support [m].
double local_spacing(const NeighbourhoodRule& rule, double support);
/// Counts phyxels at each plane of symmetry of a body.
/// @param spacing at each phyxel [m]; of one element: of all
std::vector<PlaneCounts> count_at_planes(const BodyRequest& request,
                                         std::span<const double> spacing,
                                         std::span<const Vec3d> position);

/// A plane of symmetry that holds the phyxels within a distance.
struct SymmetryPlane {
  PlaneNormal normal = PlaneNormal::x;
  double at = 0, reach = 0;  ///< [m]
  bool holds(Vec3d place) const;
  Axes axes() const;  ///< The axis along which it holds them.
};
/// Returns the planes of symmetry of a body, which hold the phyxels that lie on them, or, of a body
/// that has none there, its outermost layer, with a warning.
/// @param counts of each plane, in the whole body
/// @throws InputError for a plane at which the body does not end
std::vector<SymmetryPlane> symmetry_planes(const BodyRequest& request, const BodyExtent& extent,
                                           std::span<const PlaneCounts> counts,
                                           std::vector<std::string>& warnings);

}  // namespace phyxel
