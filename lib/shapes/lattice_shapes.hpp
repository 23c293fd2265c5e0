/// Boxes, cylinders and spheres filled by a lattice with a phyxel in each cell, or at each node.
#pragma once

#include <array>
#include <cstdint>

#include "model/cloud_piece.hpp"
#include "phyxel/shapes.hpp"
#include "shapes/layers.hpp"

namespace phyxel {

/// Names of the sides along each axis: of regions of phyxels and of groups of triangles.
inline constexpr const char* side_names[3][2] = {{"x-", "x+"}, {"y-", "y+"}, {"z-", "z+"}};

/// A region of space whose inside holds phyxels of a lattice, with layers on its boundary.
struct LatticeRoom {
  SupportCut cut;
  std::array<std::array<double, 2>, 3> layers;  ///< The first layer inside and the end, by axis.
};

/// A solid and a lattice over its bounding box. The axis of a cylinder is the z axis.
struct Lattice {
  using Site = std::array<std::int64_t, 3>;  ///< Numbers of layers.
  enum class Solid { box, cylinder, sphere };
  Solid solid = Solid::box;
  Vec3d low;                     ///< Lower corner of the bounding box [m].
  Vec3d extent;                  ///< Size of the bounding box [m].
  double cells = 1;              ///< Cells across a round solid, an integer.
  std::array<Layers, 3> layers;  ///< By axis.
  std::vector<LatticeRoom> rooms;
  std::vector<SupportCut> moved;  ///< `SupportCuts::moved`.
  double depth = 0;  ///< How deep phyxels lie below the boundaries of rooms, a rounding error [m].

  double volume() const;         ///< Volume of the solid [m^3].
  bool contains(Vec3d p) const;  ///< True if `p` is strictly inside the solid.
  /// True if a site is in the solid, in exact arithmetic.
  bool holds(const Site& site) const;
  Vec3d place(const Site& site) const;  ///< [m]
  /// The part of the bounding box that a site stands for [m^3]: half of the way to the next one
  /// along each axis, but no part of another room.
  double share(const Site& site) const;
  /// Number of sites in the solid; an estimate above 1e11.
  double phyxels() const;
};

/// The lattice of a checked request, with cells of about `spacing` [m].
Lattice make_lattice(const ShapeRequest& request, double spacing);

/// Fills the solid with a phyxel at each site, in the order of a Morton curve, and makes the
/// regions of its faces. Volumes are the sites' shares, in a round solid multiplied by a factor
/// with which their sum is the solid's volume. Phyxels are displaced randomly by up to `jitter`
/// cells in each direction, but not out of the solid, nor off a face or plane that their layer is
/// laid on.
CloudPiece fill_lattice(const Lattice& lattice, double jitter, std::uint64_t seed,
                        Piece piece = {});

/// The closed surface of the solid with vertices about `spacing` [m] apart, or farther apart if
/// there would be more than a million. @param corners a circle has this number at least
Surface lattice_surface(const Lattice& lattice, double spacing, int corners = 16);

/// The spacing [m] at which a shape has about `phyxels` phyxels; `piece` is the part of the shape
/// that this process will make. @throws InputError
double spacing_for(const ShapeRequest& request, Index phyxels, Piece piece);

/// Makes a lattice shape, or a piece of its phyxels with the whole surface.
/// @throws InputError as `make_shape`
CloudPiece make_lattice_shape(const ShapeRequest& request, Piece piece = {});

}  // namespace phyxel
