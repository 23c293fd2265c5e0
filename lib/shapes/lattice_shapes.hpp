/// Boxes, cylinders and spheres filled by a lattice of cells with a phyxel in each, or at each
/// corner.
#pragma once

#include <array>
#include <cstdint>

#include "model/cloud_piece.hpp"
#include "phyxel/shapes.hpp"

namespace phyxel {

/// A solid and the cells that tile the box around it. The z axis of a cylinder is the body's.
struct Lattice {
  enum class Solid { box, cylinder, sphere };
  Solid solid = Solid::box;
  Vec3d low;                    ///< Lower corner of the box [m].
  Vec3d extent;                 ///< [m]
  std::array<double, 3> cells;  ///< Whole numbers, 1 or more; doubles because they may be absurd.
  bool nodes = false;           ///< Boxes only: phyxels at the cells' corners.

  Vec3d cell() const { return {extent.x / cells[0], extent.y / cells[1], extent.z / cells[2]}; }
  double volume() const;         ///< Of the solid [m^3].
  bool contains(Vec3d p) const;  ///< Strictly inside the solid.
  /// Places of phyxels along an axis.
  double places(int axis) const { return cells[axis] + (nodes ? 1 : 0); }
  /// Whether the place of a phyxel is in the solid, free of rounding.
  bool holds(const std::array<std::int64_t, 3>& place) const;
  /// Places in the solid; estimated where that is beyond 1e11.
  double phyxels() const;
};

/// The solid of a checked request, in cells of about `spacing` [m].
Lattice make_lattice(const ShapeRequest& request, double spacing);

/// A phyxel at each place in the solid, all with the same volume but for shares of nodes on faces,
/// in the order of a Morton curve over the places; with regions. Phyxels are moved by up to
/// `jitter` cells in each direction, but not out of the solid, nor off its faces.
CloudPiece fill_lattice(const Lattice& lattice, double jitter, std::uint64_t seed,
                        Piece piece = {});

/// The closed surface of the solid with vertices about `spacing` [m] apart, or more where that
/// would be over a million.
Surface lattice_surface(const Lattice& lattice, double spacing);

/// `spacing_for`, by whoever makes a piece. @throws InputError
double spacing_for(const ShapeRequest& request, Index phyxels, Piece piece);

/// A shape that is a lattice, or a piece of it with all of its surface. @throws InputError as
/// `make_shape`
CloudPiece make_lattice_shape(const ShapeRequest& request, Piece piece = {});

}  // namespace phyxel
