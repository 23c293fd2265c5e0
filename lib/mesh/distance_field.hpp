/// Making a field of distances from a surface.
#pragma once

#include <cstdint>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/physics/distance_field.hpp"

namespace phyxel {

/// The arrays of a field of distances, and its deepest place.
struct DistanceArrays {
  DistanceField shape;  ///< Without pointers.
  std::vector<std::int32_t> brick;
  std::vector<float> coarse, fine;
  double depth = 0;  ///< Largest distance inside the surface at a corner or node [m].
  Vec3d deepest;     ///< Where that is [m].

  /// A view of the arrays, which must outlive it.
  DistanceField view() const;
  std::size_t bytes() const;
};

/// The distance between the nodes of a field over the smallest support of the phyxels beside it:
/// about half a spacing of these.
inline constexpr double nodes_over_support = 0.25;

/// The largest number of nodes of a field: 400 MB.
inline constexpr double most_field_nodes = 1e8;

/// Finds the signed distances from a closed surface whose normals point outwards. The result has
/// the same bits on any number of threads.
/// @param spacing of nodes near the surface [m]; it grows if there would be more than `most_nodes`
/// @param band distance from the surface up to which nodes are that near to each other [m]
/// @param margin least distance from the surface up to which points are in the grid [m]
DistanceArrays distances_from(const Surface& surface, double spacing, double band,
                              double margin = 0, double most_nodes = most_field_nodes);

}  // namespace phyxel
