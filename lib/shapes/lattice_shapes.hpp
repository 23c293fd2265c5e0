/// Boxes, cylinders and spheres filled by a lattice with a phyxel in each cell, or at each node.
#pragma once

#include <array>
#include <cstdint>

#include "model/cloud_piece.hpp"
#include "phyxel/shapes.hpp"

namespace phyxel {

/// Names of the sides along each axis: of regions of phyxels and of groups of triangles.
inline constexpr const char* side_names[3][2] = {{"x-", "x+"}, {"y-", "y+"}, {"z-", "z+"}};

/// A solid and a lattice of cells over its bounding box. The axis of a cylinder is the z axis.
struct Lattice {
  enum class Solid { box, cylinder, sphere };
  Solid solid = Solid::box;
  Vec3d low;                    ///< Lower corner of the bounding box [m].
  Vec3d extent;                 ///< Size of the bounding box [m].
  std::array<double, 3> cells;  ///< Integers of 1 or more, as doubles because they may overflow.
  bool nodes = false;           ///< True if phyxels are at the cells' corners (boxes only).

  Vec3d cell() const { return {extent.x / cells[0], extent.y / cells[1], extent.z / cells[2]}; }
  double volume() const;         ///< Volume of the solid [m^3].
  bool contains(Vec3d p) const;  ///< True if `p` is strictly inside the solid.
  /// Number of lattice sites (cells or nodes) along an axis.
  double places(int axis) const { return cells[axis] + (nodes ? 1 : 0); }
  /// True if a lattice site is in the solid, in exact arithmetic.
  bool holds(const std::array<std::int64_t, 3>& place) const;
  /// Number of lattice sites in the solid; an estimate above 1e11.
  double phyxels() const;
};

/// The lattice of a checked request, with cells of about `spacing` [m].
Lattice make_lattice(const ShapeRequest& request, double spacing);

/// Fills the solid with a phyxel at each lattice site, in the order of a Morton curve, and makes
/// the regions of its faces. Volumes are equal, except that nodes on faces, edges and corners have
/// their share of a cell. Phyxels are displaced randomly by up to `jitter` cells in each direction,
/// but not out of the solid, nor off its faces.
CloudPiece fill_lattice(const Lattice& lattice, double jitter, std::uint64_t seed,
                        Piece piece = {});

/// The closed surface of the solid with vertices about `spacing` [m] apart, or farther apart if
/// there would be more than a million.
Surface lattice_surface(const Lattice& lattice, double spacing);

/// The spacing [m] at which a shape has about `phyxels` phyxels; `piece` is the part of the shape
/// that this process will make. @throws InputError
double spacing_for(const ShapeRequest& request, Index phyxels, Piece piece);

/// Makes a lattice shape, or a piece of its phyxels with the whole surface.
/// @throws InputError as `make_shape`
CloudPiece make_lattice_shape(const ShapeRequest& request, Piece piece = {});

}  // namespace phyxel
