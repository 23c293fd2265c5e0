/// The parsers behind read_mesh(), for content in memory; the fuzzer calls them too.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

enum class MeshFormat { obj, ply, stl };

/// Parses `content` as a mesh; error messages call the file `name`.
/// @throws InputError as read_mesh() does.
Surface parse_mesh(std::string_view content, MeshFormat format, const std::string& name);

Surface parse_obj(std::string_view content, const std::string& name);
Surface parse_ply(std::string_view content, const std::string& name);
Surface parse_stl(std::string_view content, const std::string& name);

/// Largest mesh file [bytes]. A triangle takes more than one byte, so an `Index` can count them.
inline constexpr std::size_t largest_file = std::size_t{1} << 31;

/// Largest coordinate [m]: larger ones would overflow in areas and volumes.
inline constexpr double largest_coordinate = 1e30;

/// Largest number of corners of a polygon: triangulation takes at least quadratic time.
inline constexpr std::size_t largest_polygon = 2000;

/// Largest number of named groups of a mesh. Colours of more are shades, and no groups.
inline constexpr std::size_t most_groups = 1000;

/// Groups of faces by their names, as a file lists them. Names are those of phyxels' regions, so
/// that they may not contain "/".
class FaceGroups {
 public:
  /// Adds a face to the group with a name; an empty name is no group.
  /// @param face its number in the file, not less than that of the group's last face
  void add(std::string_view name, Index face);
  /// Returns groups of triangles. @param first_triangle of each face, and the number of all
  std::map<std::string, std::vector<Index>> of_triangles(
      std::span<const std::size_t> first_triangle) const;

 private:
  std::map<std::string, std::vector<Index>, std::less<>> faces_;
};

/// Triangulates a simple polygon, not necessarily flat or convex, by ear clipping and appends the
/// triangles. They have the polygon's boundary whatever its shape, so that a closed mesh stays
/// closed.
void append_polygon(std::span<const Index> corners, const std::vector<Vec3d>& position,
                    std::vector<Triangle>& triangle);

/// Triangulates all faces of a file and sets the groups of the triangles.
/// @param face_start where the corners of each face begin, and the number of all
void append_polygons(std::span<const Index> corner, std::span<const std::size_t> face_start,
                     const FaceGroups& groups, Surface& surface);

}  // namespace phyxel
