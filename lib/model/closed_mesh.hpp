/// Closed surfaces from files, inside which something is to be.
#pragma once

#include <filesystem>
#include <string>

#include "phyxel/mesh.hpp"

namespace phyxel {

/// Reads a closed surface, and turns its triangles outwards.
/// @param where the place in the scene that names the file; may be empty
/// @throws InputError naming the file, for one that cannot be read, and for a surface that is open
Surface read_closed_mesh(const std::filesystem::path& file, const std::string& where);

}  // namespace phyxel
