/// body.h5: a sampled cloud on disk.
#pragma once

#include <filesystem>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// Writes a cloud (phyxels, volumes, surfels, regions). Written to a temporary name, then renamed.
/// @throws InputError if `file` exists and `overwrite` is false, or its folder cannot be written;
///   OutputError if writing fails.
void write_body(const std::filesystem::path& file, const Cloud& cloud, bool overwrite);

/// Reads a file written by `write_body`. @throws InputError naming the file and what is wrong with
/// it.
Cloud read_body(const std::filesystem::path& file);

}  // namespace phyxel
