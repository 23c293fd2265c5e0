/// Pictures as PNG files.
#pragma once

#include <filesystem>

#include "rasteriser.hpp"

namespace phyxel::app {

/// Writes an 8-bit sRGB PNG to a temporary name beside `file`, then renames it: a file of that name
/// is whole or as it was. @throws OutputError
void write_png(const std::filesystem::path& file, const Image& image);

}  // namespace phyxel::app
