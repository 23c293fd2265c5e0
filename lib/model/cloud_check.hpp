/// Checks of the clouds and surfaces that callers hand over.
#pragma once

#include <span>
#include <string>

#include "phyxel/cloud.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

/// Largest coordinate [m]; also the bound of lengths in scenes (scene/scene_keys.cpp).
inline constexpr double longest_length = 1e12;

/// Checks that each corner of each triangle is one of so many vertices.
/// @throws InputError with the first triangle and corner that are not so
void check_triangles(std::span<const Triangle> triangles, std::size_t vertices);

/// Checks that the vertices of a surface are finite, and that triangles name no others.
/// @throws InputError with the first vertex or triangle that is not so
void check_surface(const Surface& surface);

/// Checks that an order names each phyxel of a cloud once, and that volumes and regions belong to
/// its phyxels. @throws InputError with the first entry that is not so
void check_order(const Cloud& cloud, std::span<const Index> order);

/// Checks that a cloud has phyxels; as many volumes, or none; finite values within the bounds of
/// scenes; a normal for each surfel; triangles of its own surfels; regions of its own phyxels,
/// ascending.
/// @param where,whose begin and end of the words that name a place, e.g. "scene.toml:3:1: " and
///   " of body \"ball\""
/// @throws InputError naming the array, its value, and what is allowed
void check_cloud(const Cloud& cloud, const std::string& where, const std::string& whose);

/// Checks that the cloud of a body can carry the physics. @throws InputError naming the body
void check_cloud(const BodyRequest& request, const Cloud& cloud);

}  // namespace phyxel
