/// Reading closed surfaces from files, and filling them with phyxels.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/grading.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

/// Reads a triangulated surface from an OBJ, PLY or STL file (chosen by its extension).
/// Polygons are triangulated, identical STL corners are merged, and normals are recomputed.
/// @throws InputError naming the file and the line, byte or element for a missing, unreadable,
///   empty, malformed or non-finite file, or indices out of range.
Surface read_mesh(const std::filesystem::path& file);

/// Numbers of defects of a surface, and the position of one.
struct SurfaceDefects {
  Index open_edges = 0;            ///< Edges with one triangle: holes.
  Index crowded_edges = 0;         ///< Edges with more than two triangles.
  Index flipped_edges = 0;         ///< Edges whose two triangles have opposite orientations.
  Index degenerate_triangles = 0;  ///< Triangles without area.
  Index unused_vertices = 0;
  Index parts = 0;          ///< Number of connected parts.
  bool inside_out = false;  ///< True if the enclosed volume is negative.
  Vec3d example;            ///< Midpoint of one defective edge or triangle [m].
  /// True if the surface has no defect other than unused vertices.
  bool clean() const;
  std::string describe() const;  ///< Description in one line.
};
/// Finds the defects of a surface.
/// @throws InputError for a vertex that is not finite, and for a triangle that names no vertex
SurfaceDefects inspect_surface(const Surface& surface);

/// Parameters for filling a surface with phyxels.
struct SampleRequest {
  Index phyxels = 0;       ///< Exact number of phyxels.
  std::uint64_t seed = 1;  ///< The same seed gives the same cloud on any number of threads.
  /// Sweeps that spread the phyxels evenly; 0 for none. They are sweeps of Lloyd's relaxation along
  /// sharp edges and in bodies whose phyxels all lie inside; elsewhere a third as many sweeps of
  /// repulsion do as well.
  int relaxations = 30;
  /// True to place phyxels also on the surface, its corners and its sharp edges; false to place all
  /// inside, in the middle of their cells; unset for the surface if it allows that.
  std::optional<bool> on_surface;
  /// Regions at whose boundaries supports of the body end: if there are phyxels on the surface,
  /// there are also some on these boundaries, and the cloud has the regions as its `cuts`.
  std::vector<SpaceRegion> cuts;
  /// Unset for the same distance everywhere. A graded body has phyxels on its surface.
  std::optional<Grading> grading;
};

/// Statistics of a sampled surface.
struct SampleReport {
  SurfaceDefects defects;
  double volume = 0;             ///< Volume inside the surface [m^3].
  double doubtful_fraction = 0;  ///< Share of interior points with an ambiguous winding number.
  double spacing = 0;            ///< Mean distance to the nearest phyxel [m].
  double smallest_gap = 0;       ///< Smallest distance between two phyxels [m].
  Index on_surface = 0;          ///< Number of phyxels on the surface.
  std::vector<std::string> warnings;
};

/// Fills `surface` with exactly `request.phyxels` well-spread phyxels; each gets its share of the
/// enclosed volume. The surface's vertices become the surfels. With phyxels on the surface, those
/// deep inside are nodes of a cubic lattice, and those in between are evened out by repulsion;
/// else all are scattered.
/// Source of the inside test: Jacobson et al. 2013 (generalised winding number), with the fast
/// summation of Barill et al. 2018.
/// @throws InputError for a surface without volume, or so open that its inside is undefined; and,
/// if
///   phyxels on the surface are requested, for a surface that is open or overlaps itself, and for
///   too few phyxels
Cloud sample_surface(const Surface& surface, const SampleRequest& request,
                     SampleReport* report = nullptr);

}  // namespace phyxel
