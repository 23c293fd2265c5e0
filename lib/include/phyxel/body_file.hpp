/// body.h5: a sampled cloud on disk.
#pragma once

#include <filesystem>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// Writes a cloud (phyxels, volumes, surfels, regions) atomically.
/// @throws InputError for a cloud whose arrays do not fit together or are not finite, if `file`
/// exists and `overwrite` is false, or if its folder cannot be written;
///   OutputError if writing fails
void write_body(const std::filesystem::path& file, const Cloud& cloud, bool overwrite);

/// True if a body file holds spacings (`Cloud::spacing`), as graded clouds have; false if it cannot
/// be read. Reads no arrays.
bool has_spacing(const std::filesystem::path& file);

/// Reads a file written by `write_body`. @throws InputError naming the file and the fault
Cloud read_body(const std::filesystem::path& file);

}  // namespace phyxel
