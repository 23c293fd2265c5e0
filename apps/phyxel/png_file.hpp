/// Pictures as PNG files.
#pragma once

#include <filesystem>

#include "rasteriser.hpp"

namespace phyxel::app {

/// Writes an 8-bit sRGB PNG atomically, by a temporary file that is renamed. @throws OutputError
void write_png(const std::filesystem::path& file, const Image& image);

}  // namespace phyxel::app
