/// Built-in bodies that need no file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/grading.hpp"

namespace phyxel {

/// Request for a built-in shape. Which members matter depends on the shape:
/// "beam", "block": `size` (beam lies along x, its end x = 0 at the origin and its axis on the
/// x axis; the block is centred on the origin); "cylinder": `radius`, `length` (along z, centred);
/// "sphere": `radius` (centred). These are filled by a lattice of `spacing`, each phyxel moved by
/// up to `jitter` spacings in each direction, but not off a face that it lies on. Without a lattice
/// (`fitted`), the mean volume of a phyxel is the cube of `spacing`. "alien_head" (238 phyxels,
/// 16,000 surfels), "horn_bug" (666; 1,460) and "dino" (575; 53,504): the bodies of Farias
/// et al. 2008, section 6; their counts are fixed, about 1 m tall.
struct ShapeRequest {
  /// Placement of phyxels in a lattice. `cells`: in the middle of each cell. `nodes` (not in a
  /// sphere): on flat faces too, in a beam or block on all edges and corners, each with its share
  /// of the adjacent cells' volume, which is more accurate at the surface. `fitted`: no lattice,
  /// but phyxels on and inside the surface as `sample_surface` lays them, also on round faces and
  /// along supports of any shape.
  enum class Placement { cells, nodes, fitted };

  std::string name;
  Vec3d size;          ///< Extents [m].
  double radius = 0;   ///< [m]
  double length = 0;   ///< [m]
  double spacing = 0;  ///< Lattice spacing [m].
  double jitter = 0;   ///< Fraction of the spacing, 0 to 0.5.
  Placement placement = Placement::cells;
  std::uint64_t seed = 1;  ///< Seed of the jitter, which does not depend on the number of threads.
  bool surface = true;     ///< True to make surfels.
  /// Regions in which the body will be held or moved. Layers of phyxels lie on faces of boxes along
  /// the axes, or on all boundaries if `fitted`, so that supports act where these end:
  /// `Cloud::cuts`.
  std::vector<SupportRegion> supports = {};
  /// Unset for the same distance everywhere. Needs `fitted`.
  std::optional<Grading> grading = {};
  bool operator==(const ShapeRequest&) const = default;
};

/// The names of the shapes.
const std::vector<std::string>& shape_names();

/// True for the paper's three bodies, whose sizes and counts are fixed.
bool is_paper_shape(const std::string& name);

/// Lattice spacing [m] that fills the shape with about `phyxels` phyxels.
double spacing_for(const ShapeRequest& request, Index phyxels);

/// The most accurate placement of the phyxels of a beam, block, cylinder or sphere. Phyxels should
/// lie on the surface, but not if the shape is thinner than a spacing, since phyxels on opposite
/// faces would then be nearest to each other. A shape has a lattice if layers can lie on its whole
/// surface and on the boundaries of its supports; else it is `fitted`, if its gradients are closed.
/// @param request with its spacing and supports
/// @param closed whether gradients will be closed
/// @throws InputError as `make_shape`
ShapeRequest::Placement best_placement(const ShapeRequest& request, bool closed = true);

/// The reason why a shape cannot have its placement, for error messages after "lattice = ": the
/// values found, and the ones allowed. Empty if the shape can have it.
std::string objection_to_placement(const ShapeRequest& request);

/// Makes a built-in body: phyxels with volumes, surfels, and named regions ("x-", "x+", "y-", ...
/// for the outermost layer of phyxels on that side of a box; "z-", "z+" for a cylinder; "mouth"
/// for the dino, "neck" for the alien head, "leg" for the horn bug). The triangles of the flat
/// sides are groups of the surface by the same names; the group "side" goes around a cylinder.
/// @throws InputError for an unknown name, or sizes, spacing or jitter out of range.
Cloud make_shape(const ShapeRequest& request);

}  // namespace phyxel
