/// The readers behind read_mesh(), on content already in memory: what the fuzzer feeds.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

enum class MeshFormat { obj, ply, stl };

/// Reads `content` as a mesh; `name` stands for the file in messages.
/// @throws InputError as read_mesh() does.
Surface parse_mesh(std::string_view content, MeshFormat format, const std::string& name);

Surface parse_obj(std::string_view content, const std::string& name);
Surface parse_ply(std::string_view content, const std::string& name);
Surface parse_stl(std::string_view content, const std::string& name);

/// [bytes]; a triangle takes more than one, so their number fits an `Index`.
inline constexpr std::size_t largest_file = std::size_t{1} << 31;

/// Coordinates beyond this would overflow in areas and volumes [m].
inline constexpr double largest_coordinate = 1e30;

/// Polygons with more corners are refused: cutting them up takes quadratic time and more.
inline constexpr std::size_t largest_polygon = 2000;

/// Cuts a simple polygon, not necessarily flat or convex, into triangles by ear clipping, and
/// appends them. Whatever its shape, the triangles together have the polygon's boundary, so that
/// a closed mesh stays closed.
void append_polygon(std::span<const Index> corners, const std::vector<Vec3d>& position,
                    std::vector<Triangle>& triangle);

}  // namespace phyxel
