/// The parsers behind read_mesh(), for content in memory; the fuzzer calls them too.
#pragma once

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

/// Triangulates a simple polygon, not necessarily flat or convex, by ear clipping and appends the
/// triangles. They have the polygon's boundary whatever its shape, so that a closed mesh stays
/// closed.
void append_polygon(std::span<const Index> corners, const std::vector<Vec3d>& position,
                    std::vector<Triangle>& triangle);

}  // namespace phyxel
