/// docs/scaling.md from the tables of `phyxel bench scaling`.
#pragma once

#include <filesystem>

namespace phyxel::app {

/// @param results folder of cpu_ranks_<n>.csv; without one for a single rank nothing is written
/// @throws InputError for a table that is not one of ours; OutputError
void write_scaling_page(const std::filesystem::path& results, const std::filesystem::path& page);

}  // namespace phyxel::app
