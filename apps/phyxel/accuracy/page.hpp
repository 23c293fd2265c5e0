/// The page about accuracy, made of its table.
#pragma once

#include <filesystem>

namespace phyxel::app {

/// From `accuracy.csv` in a folder of results, with charts beside it where gnuplot is.
/// @throws InputError if the table is not there or is not one of ours; OutputError
void write_accuracy_page(const std::filesystem::path& results, const std::filesystem::path& page);

}  // namespace phyxel::app
