/// One deformable body at rest, before it has neighbours, masses or a material.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "phyxel/space_region.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Indices of three vertices, counter-clockwise seen from outside.
using Triangle = std::array<Index, 3>;

/// A triangulated surface. As part of a `Cloud` its vertices are the surfels.
struct Surface {
  std::vector<Vec3d> position;     ///< Vertex positions [m], shape [n_surfels, 3].
  std::vector<Vec3d> normal;       ///< Outward unit normals, shape [n_surfels, 3].
  std::vector<Triangle> triangle;  ///< Vertex indices, counter-clockwise seen from outside.
  /// Named groups of triangles (ascending indices), which may overlap.
  std::map<std::string, std::vector<Index>> groups = {};
};

/// A region of space in which a body is held or moved, and on whose boundary phyxels lie.
struct SupportCut {
  SpaceRegion support;  ///< The region as the scene has it.
  /// The region on whose boundary phyxels lie: `support`, with faces that are nearly the body's
  /// moved outward.
  SpaceRegion wall;
  bool operator==(const SupportCut&) const = default;
};

/// The cuts of a body made from a mesh or a lattice. Inside a region in which all phyxels are held,
/// none is a neighbour of one on the boundary or outside: the clamp then acts at the boundary,
/// instead of being smeared over a support of its phyxels.
struct SupportCuts {
  std::vector<SupportCut> list;
  double depth = 0;    ///< Largest depth of phyxels below their boundary, a rounding error [m].
  double spacing = 0;  ///< Distance within which each place of a boundary has a phyxel [m].
  double shift = 0;    ///< Length of the body's translation, whose digits coordinates lack [m].
  /// Supports in a lattice some of whose faces have no layer, because it would be too near to
  /// another layer or an end: `wall` is the region that holds phyxels instead, whose faces are on
  /// the nearest layers or ends.
  std::vector<SupportCut> moved = {};
};

/// Rest points of one body, in the caller's order.
struct Cloud {
  std::vector<Vec3d> position;  ///< Phyxel positions [m], shape [n_phyxels, 3].
  std::vector<double> volume;   ///< Phyxel volumes [m^3], shape [n_phyxels]; empty if unknown.
  Surface surface;              ///< Surfels; may be empty.
  /// Named groups of phyxels (sorted indices) that scenes can select, e.g. "mouth".
  std::map<std::string, std::vector<Index>> regions;
  /// True for a regular lattice, whose gradients are not closed unless a scene asks for it.
  bool lattice = false;
  /// Distance between neighbouring phyxels that each was placed for [m], shape [n_phyxels]. Graded
  /// clouds have it, and their supports follow from it; empty if unknown.
  std::vector<double> spacing;
  SupportCuts cuts;                   ///< Where supports end inside the body.
  std::vector<std::string> warnings;  ///< Warnings of the generator or sampler, for the summary.
};

/// Area-weighted vertex normals of a triangulated surface, outward for outward triangles.
/// @throws InputError for a triangle that names no vertex
std::vector<Vec3d> vertex_normals(const std::vector<Vec3d>& position,
                                  const std::vector<Triangle>& triangle);

/// Volume enclosed by a closed surface [m^3] (divergence theorem); negative if inside out.
/// @throws InputError for a triangle that names no vertex
double enclosed_volume(const Surface& surface);

/// Permutes the phyxels: phyxel order[k] becomes phyxel k. Regions are renumbered.
/// @throws InputError if `order` is not a permutation of the phyxels, and for a number of volumes
/// or a region that does not fit them
void reorder(Cloud& cloud, const std::vector<Index>& order);

/// Reorders the phyxels along a Morton (Z-order) curve, so that neighbours in space are
/// neighbours in memory; regions are renumbered. Every generator and sampler calls it last.
void order_along_curve(Cloud& cloud);

}  // namespace phyxel
